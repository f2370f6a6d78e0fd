"""Scene files that come with the package, copied to where they can be changed."""

from __future__ import annotations

from pathlib import Path

from taichi_rts.errors import OutputError, SceneError, did_you_mean
from taichi_rts.scene.files.reading import parts_with_files, tomllib
from taichi_rts.scene.loading import BUILT_IN, scene_names

EXAMPLES = BUILT_IN / "examples"
"""Commented files that show nearly all keys, and the meshes that they name."""


def example_names() -> list[str]:
    """List the names of the commented examples."""
    return sorted(path.stem for path in EXAMPLES.glob("*.toml"))


def copy_scene(name: str, folder: Path) -> list[Path]:
    """Write the file of the built-in scene or example `name`, and what it names, into `folder`; return their paths.

    Raises `SceneError` for an unknown name, and `OutputError` for a file that is there already or cannot be written.
    """
    known = [*scene_names(), *example_names()]
    stem = name.removesuffix(".toml")
    if stem not in known:
        hint = did_you_mean(stem, known)
        raise SceneError(f"--copy {name!r} is no scene of this package{hint} (known: {', '.join(known)})")
    source = next(path for path in (BUILT_IN / f"{stem}.toml", EXAMPLES / f"{stem}.toml") if path.is_file())
    data = tomllib.loads(source.read_text(encoding="utf-8"))
    names = [source.name, *dict.fromkeys(part["file"] for _, part in parts_with_files(data))]
    if found := [each for each in names if (folder / each).exists()]:
        raise OutputError(
            f"{folder / found[0]} is there already, and --copy replaces nothing; move it, or go elsewhere"
        )
    written = []
    for each in names:
        try:
            with (folder / each).open("xb") as file:
                file.write((source.parent / each).read_bytes())
        except OSError as error:
            raise OutputError(f"{folder / each} cannot be written: {error.strerror}; go to another folder") from None
        written.append(folder / each)
    return written
