# Two commands do all the set-up on a fresh machine: `make demo` and `make test`.
# A Python from 3.10 to 3.13 is needed; PYTHON=... chooses one, else the newest found is taken.
PYTHON ?= $(shell for p in python3.13 python3.12 python3.11 python3.10 python3 python; do \
	$$p -c 'import sys, venv; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null && echo $$p && break; done)
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: help demo test test-slow lint types format api clean

help:
	@echo "make demo    render the double dam break, coloured by region, into out/double_dam_break"
	@echo "make test    run the tests; make test-slow the long ones"
	@echo "make api     write the API reference into build/api"
	@echo "make lint types format clean"

# One stamp for each set of packages: the demo needs no developer's tools.
$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "no Python 3.10 to 3.13 with the venv module found; install one" \
		"(Debian: apt-get install python3-venv) or name it: make PYTHON=/path/to/python3.12" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.installed-dev: $(VENV)/bin/python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@ $(VENV)/.installed

demo: $(VENV)/.installed
	$(BIN)/python demos/double_dam_break.py --overwrite

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -n auto --dist loadscope -m "not slow"

# What `test` leaves out to stay quick: whole scenes and commands, of which it runs small ones. The gate runs both.
test-slow: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -n auto --dist loadscope -m slow

lint: $(VENV)/.installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports

types: $(VENV)/.installed-dev
	$(BIN)/mypy

format: $(VENV)/.installed-dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# From docstrings; open build/api/index.html.
api: $(VENV)/.installed-dev
	$(BIN)/python docs/api.py

clean:
	rm -rf $(VENV) build dist out *.egg-info .pytest_cache .ruff_cache .mypy_cache .import_linter_cache
