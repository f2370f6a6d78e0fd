"""Where Taichi keeps compiled kernels, and what happens if there is no such place. Import it before Taichi.

Taichi ends the process while it is imported if neither HOME nor XDG_CACHE_HOME is set, and crashes when the process ends if it
cannot write to its cache.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
import warnings

from taichi_rts.device import forks

VARIABLE = "TI_OFFLINE_CACHE_FILE_PATH"


def home_for_taichi() -> dict[str, str]:
    """Return what the environment lacks for Taichi to be imported: a place for caches, of this process; `usable_folder` warns."""
    if os.name == "nt" or os.environ.get("HOME") or os.environ.get("XDG_CACHE_HOME"):
        return {}
    _homeless.append(_temporary_folder())
    return {"XDG_CACHE_HOME": _homeless[0]}


def usable_folder(folder: str) -> str:
    """Return `folder` if files can be written there, else one that is removed when the process ends, with one warning."""
    if not _homeless or not folder.startswith(_homeless[0]):
        try:
            os.makedirs(folder, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(b"0")
            return folder
        except OSError as error:
            reason = f"{folder} cannot be written to ({error.strerror or error})"
    else:
        reason = "neither HOME nor XDG_CACHE_HOME is set"
    temporary = _temporary_folder()
    os.environ[VARIABLE] = temporary  # for processes that this one starts too
    warnings.warn(
        f"compiled kernels are not kept, so every start compiles them again: {reason}; set {VARIABLE} or XDG_CACHE_HOME "
        "to a folder that can be written to",
        stacklevel=4,
    )
    return temporary


_homeless: list[str] = []


def _temporary_folder() -> str:
    folder = tempfile.mkdtemp(prefix="taichi_rts_")
    owner = os.getpid()

    def remove() -> None:
        if os.getpid() == owner:  # not a forked child
            taichi = sys.modules.get(forks.chosen().module)
            if taichi is not None:
                taichi.reset()  # it writes its kernels when it ends
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder
