"""Files and folders under a temporary name, while they are written.

A process holds a lock on what it writes. A killed process leaves its file behind, but not its lock:
``sweep`` removes what nobody holds any more.
"""

import fcntl
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

SUFFIX = ".coramp-unfinished"
LONGEST_PREFIX = 100
"""Bytes of the final name that the temporary one repeats; file systems allow 255 in all."""


def is_unfinished(name: str) -> bool:
    """Returns whether a file's or folder's name is one that ``unfinished`` gives."""
    return name.startswith(".") and name.endswith(SUFFIX)


@contextmanager
def unfinished(folder: Path, name: str, *, is_folder: bool = False) -> Iterator[Path]:
    """Gives a new, locked file or folder in ``folder``; removes it if it is still there at the end.

    ``name`` is what it will be called once it is renamed into place. Raises OSError.
    """
    path, handle = _made(folder, name, is_folder)
    try:
        yield path
    finally:
        _remove(path)
        os.close(handle)


def _made(folder: Path, name: str, is_folder: bool) -> tuple[Path, int]:
    prefix = name.encode()[:LONGEST_PREFIX].decode(errors="ignore")
    while True:
        path = folder / f".{prefix}.{secrets.token_hex(4)}{SUFFIX}"
        if is_folder:
            path.mkdir(0o700)
            handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        else:
            handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666)
        if _is_held(path, handle):
            return path, handle
        os.close(handle)


def _is_held(path: Path, handle: int) -> bool:
    """Locks a new file; False where another process swept it before that."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks, where nothing is swept either
        return True
    return path.exists()


def sweep(folder: Path) -> None:
    """Removes what killed processes left unfinished in a folder; what cannot be removed stays."""
    try:
        left = [entry for entry in folder.iterdir() if is_unfinished(entry.name)]
    except OSError:
        return
    for path in left:
        with suppress(OSError):
            handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                _remove(path)
            finally:
                os.close(handle)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
