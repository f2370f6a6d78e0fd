"""What a row of bad input is: a command that has to be refused, and what its message says."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenes import to_toml

RUN = ("run", "scene.toml", "--arch", "cpu", "--output-dir", "out")


@dataclass(frozen=True)
class Row:
    """A command that has to be refused, what its message says, and what is in the folder that it is given in.

    `scene` is written to scene.toml; what else there is `trial.fill` puts there. `hidden` is a package that is not installed.
    """

    area: str
    what: str
    args: tuple[str, ...]
    words: tuple[str, ...]
    scene: dict[str, Any] | str | bytes | None = None
    hidden: str | None = None


def prepare(folder: Path, row: Row) -> None:
    """Write the row's scene into `folder`."""
    if isinstance(row.scene, dict):
        (folder / "scene.toml").write_text(to_toml(row.scene), encoding="utf-8")
    elif row.scene is not None:
        (folder / "scene.toml").write_bytes(row.scene.encode() if isinstance(row.scene, str) else row.scene)
