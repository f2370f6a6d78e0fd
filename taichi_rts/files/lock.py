"""One run at a time in a folder."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import warnings
from pathlib import Path
from typing import Any

from taichi_rts.errors import OutputError
from taichi_rts.files.writing import require_folder, require_writable

try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None  # type: ignore[assignment]

NAME, SECOND = ".lock", ".lock.held"


class FolderLock:
    """Holds a folder for this process, from its making until `release`; the folder is made if need be.

    The system holds the lock (`flock`) and releases it when the process ends in any way; the file also says which process
    has it, for messages, and for folders that hosts share. On Windows, where other processes cannot read what is locked, the lock
    is on a second file (`filelock`). A lock that a dead process of this host left behind is taken over, with a
    warning. Raises `OutputError` if another run has the folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / NAME
        self.file = -1
        self._second: Any = None
        self._acquire()

    def check(self) -> bool:
        """Make sure that the folder still is this run's; returns False if it had gone and was made and locked again.

        Raises `OutputError` if another run has it by now.
        """
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(self.file), os.stat(self.path)):
                return True
        self._close()
        self._acquire()
        return False

    def release(self) -> None:
        """Let go of the folder."""
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(self.file), os.stat(self.path)):
                if fcntl is None:  # Windows deletes no open file; the second is still locked
                    os.close(self.file)
                    self.file = -1
                self.path.unlink()
        self._close()

    def _close(self) -> None:
        if self.file >= 0:
            os.close(self.file)
        self.file = -1
        if self._second is not None:
            self._second.release()
        self._second = None

    def _acquire(self) -> None:
        require_folder(self.folder)
        require_writable(self.folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            while True:
                self.file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644)
                holder = self._read()
                if not self._free(holder):
                    self._close()
                    raise OutputError(
                        f"{self.folder} is being written to by process {holder.get('pid')} on {holder.get('host')}; "
                        f"choose another --output-dir, or, if that run is dead, delete {self.path}"
                    )
                with contextlib.suppress(OSError):  # its holder may have deleted it before this one was locked
                    if os.path.samestat(os.fstat(self.file), os.stat(self.path)):
                        break
                self._close()
            if holder:
                warnings.warn(f"{self.folder} was left by process {holder.get('pid')}, which is dead", stacklevel=2)
            os.ftruncate(self.file, 0)
            os.lseek(self.file, 0, os.SEEK_SET)
            os.write(self.file, json.dumps({"pid": os.getpid(), "host": platform.node()}).encode())
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(
                f"{self.folder} cannot be locked: {error.strerror}; choose another --output-dir"
            ) from None

    def _read(self) -> dict[str, Any]:
        with contextlib.suppress(OSError, ValueError):
            os.lseek(self.file, 0, os.SEEK_SET)
            found = json.loads(os.read(self.file, 1000))
            return found if isinstance(found, dict) else {}
        return {}

    def _free(self, holder: dict[str, Any]) -> bool:
        """Lock the file if no other process has; what another host wrote is believed."""
        if holder and holder.get("host") != platform.node():
            return False
        if fcntl is None:
            return self._lock_second()
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    def _lock_second(self) -> bool:
        import filelock  # which only Windows needs

        lock = filelock.FileLock(self.path.with_name(SECOND), timeout=0, thread_local=False)
        try:
            lock.acquire()
        except filelock.Timeout:
            return False
        self._second = lock
        return True
