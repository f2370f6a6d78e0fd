"""What the API reference is made of: every public name says what it is, with fields, shapes, units and errors."""

import dataclasses
import inspect
import re
import subprocess
import sys
from pathlib import Path

import taichi_rts as rts

API = Path(__file__).parents[2] / "docs" / "api.py"
DIMENSIONLESS = {"longest_courant", "own_courant", "equal_step", "drift"}


def classes():
    return [getattr(rts, name) for name in rts.__all__ if inspect.isclass(getattr(rts, name))]


def members():
    """Public methods and properties of all public classes, those that they inherit from ours too: name and function."""
    for cls in classes():
        for owner in cls.__mro__:
            if not owner.__module__.startswith("taichi_rts"):
                continue
            for name, value in vars(owner).items():
                function = getattr(value, "fget", None) or getattr(value, "func", None) or value
                function = getattr(function, "__func__", function)
                if not name.startswith("_") and inspect.isfunction(function):
                    yield f"{cls.__name__}.{name}", function


def functions():
    """The same and public functions, with all that their documentation says: name, text, function."""
    for name in rts.__all__:
        if inspect.isfunction(getattr(rts, name)):
            yield name, inspect.getdoc(getattr(rts, name)), getattr(rts, name)
    for name, function in members():
        yield name, function.__doc__ or "", function


FUNCTIONS = {name: (text, function) for name, text, function in functions()}


def test_every_public_name_has_a_docstring():
    assert len(FUNCTIONS) > 120
    texts = {cls.__name__: vars(cls).get("__doc__") for cls in classes()} | {
        key: text for key, (text, _) in FUNCTIONS.items()
    }
    lacking = [name for name, text in texts.items() if not text or not re.search(r"[.:)]\s*$", text)]
    assert not lacking


def test_every_field_is_explained():
    for cls in filter(dataclasses.is_dataclass, classes()):
        text = " ".join(owner.__doc__ or "" for owner in cls.__mro__ if owner.__module__.startswith("taichi_rts"))
        lacking = [each.name for each in dataclasses.fields(cls) if not re.search(rf"\b{each.name}\b", text)]
        assert not lacking, cls.__name__


def test_arrays_have_shapes_and_numbers_units():
    kinds = {key: inspect.signature(function).return_annotation for key, (_, function) in FUNCTIONS.items()}
    kinds = {key: getattr(kind, "__name__", kind) for key, kind in kinds.items()}
    arrays = [key for key, kind in kinds.items() if "ndarray" in str(kind)]
    numbers = [key for key, kind in kinds.items() if kind == "float" and key.rpartition(".")[2] not in DIMENSIONLESS]
    assert len(arrays) > 15
    assert len(numbers) > 20
    assert [key for key in arrays if not re.search(r"\((\.\.\.|[A-Z]|dim|len)", FUNCTIONS[key][0])] == []
    assert [key for key in numbers if not re.search(r"\[[^\]]+\]", FUNCTIONS[key][0])] == []


def test_errors_that_a_function_raises_are_named():
    for key, (text, function) in FUNCTIONS.items():
        raised = set(re.findall(r"raise (?:\w+\.)?(\w+Error)\(", inspect.getsource(function)))
        owner = key.partition(".")[0]
        said = text + (inspect.getdoc(getattr(rts, owner)) or "")
        assert not [each for each in raised & set(rts.__all__) if each not in said], key


def test_the_reference_is_made(tmp_path):
    # in a process of its own, because it takes their checks out of the types that it documents
    result = subprocess.run([sys.executable, API, tmp_path], capture_output=True, text=True, timeout=120)
    assert (result.returncode, result.stderr) == (0, "")
    page = (tmp_path / "taichi_rts.html").read_text()
    ours = [name for name in rts.__all__ if not inspect.ismodule(getattr(rts, name))]  # `ti` has pages of its own
    assert [name for name in ours if f'id="{name}"' not in page] == []
    assert 'id="Uniform.courant"' in page
    text = re.sub("<[^>]+>", "", re.sub(r'<div class="pdoc-code.*?</pre></div>', "", page, flags=re.DOTALL))
    assert not re.search("0x[0-9a-f]{9}|AfterValidator", text)
    assert re.search(r"Uniform\(\s*courant: float = 0.4,", text)  # not pydantic's *args
