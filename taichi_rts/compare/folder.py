"""The folder of a comparison: what is in it, and when it may be written to."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from taichi_rts.compare import plot, table
from taichi_rts.errors import OutputError
from taichi_rts.files.writing import remove, require_folder, require_writable, write_bytes, write_json

ARTEFACTS = ("compare.json", "compare.csv", "work_precision.png", "runs")


def prepare(folder: Path, *, resume: bool = False, overwrite: bool = False) -> None:
    """Make `folder` ready: new, empty, with an earlier comparison to `resume`, or with one removed if `overwrite`.

    Raises `OutputError` if it holds an earlier comparison and neither is given, or both are, or it cannot be written to.
    Files that no comparison wrote are never touched.
    """
    if resume and overwrite:
        raise OutputError("--resume keeps the runs in the folder and --overwrite removes them; give one of the two")
    require_folder(folder)
    found = [name for name in ARTEFACTS if _holds_something(folder / name)]
    if found and not (resume or overwrite):
        raise OutputError(
            f"{folder} already holds a comparison ({', '.join(found)}); give --resume to go on with it, --overwrite to "
            "replace it, or choose another --output-dir"
        )
    require_writable(folder)
    if overwrite:
        remove(folder, found)
    try:
        (folder / "runs").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder} cannot be made: {error.strerror}; choose another --output-dir") from None


def _holds_something(path: Path) -> bool:
    return any(path.iterdir()) if path.is_dir() else path.exists()


def write(folder: Path, report: Mapping[str, Any], *, with_plot: bool = True) -> list[Path]:
    """Write the report as JSON, CSV and plot; returns the paths."""
    write_json(folder / "compare.json", report)
    write_bytes(folder / "compare.csv", table.to_csv(report))
    if with_plot:
        write_bytes(folder / "work_precision.png", plot.draw(report))
    return [folder / name for name in ARTEFACTS[: 3 if with_plot else 2]]
