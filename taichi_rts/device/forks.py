"""Which Taichi: the original or one of its forks, as `TAICHI_RTS_TAICHI` in the environment says. It imports none of them."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from taichi_rts.errors import BackendError

VARIABLE = "TAICHI_RTS_TAICHI"


@dataclass(frozen=True)
class Fork:
    """What differs between Taichi and its forks, as far as this package is concerned."""

    package: str
    """Its name for pip; with `_` in place of `-` the module that is imported."""
    requirement: str
    """What pip is to install for it."""
    banner: str = "ENABLE_TAICHI_HEADER_PRINT"
    """The environment variable that turns its banner off."""
    options: dict[str, Any] = field(default_factory=dict)
    """For its `init`."""

    @property
    def module(self) -> str:
        """What is imported."""
        return self.package.replace("-", "_")


FORKS = {
    each.module: each
    for each in (
        Fork("taichi", "taichi"),
        # Its default, compile_tier="balanced", leaves out optimisations: loops over neighbours took 30 times as long.
        Fork("taichi-forge", "taichi_rts[forge]", options={"compile_tier": "full"}),
        Fork("quadrants", "taichi_rts[quadrants]", banner="ENABLE_QUADRANTS_HEADER_PRINT"),
    )
}


def chosen() -> Fork:
    """Return the fork that the environment names, Taichi itself if none; raises `BackendError` if there is none of that name."""
    name = os.environ.get(VARIABLE) or "taichi"
    if name not in FORKS:
        raise BackendError(
            f"{VARIABLE}={name!r} in the environment is unknown; choose one of {', '.join(FORKS)}, and install a fork with "
            "pip install 'taichi_rts[forge]' or 'taichi_rts[quadrants]'"
        )
    return FORKS[name]


def missing(fork: Fork) -> BackendError:
    """Return the error that says that the fork is not installed, and how to install it or another."""
    said = (
        f"{VARIABLE}={fork.module!r}"
        if os.environ.get(VARIABLE)
        else f"{VARIABLE} is not set, so Taichi is wanted, which"
    )
    return BackendError(
        f"{said} is not installed; install it with pip install '{fork.requirement}', or set {VARIABLE} to another of "
        f"{', '.join(FORKS)} (Taichi itself has no wheels for Python 3.14 and later: pip install 'taichi_rts[forge]')"
    )


def versions() -> dict[str, str]:
    """Return the package that is used as Taichi and its version, for what is written down about a run."""
    package = chosen().package
    try:
        return {package: version(package)}
    except PackageNotFoundError:  # built from source, without metadata
        return {package: "unknown"}
