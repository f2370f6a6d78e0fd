"""The page of all keys of scene files is what the schema says now."""

import importlib.util
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_is_the_schemas():
    spec = importlib.util.spec_from_file_location("keys", DOCS / "keys.py")
    keys = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(keys)
    assert keys.PAGE.read_text(encoding="utf-8") == keys.page(), "run: python docs/keys.py"
