"""Safe reading and atomic writing of files in folders that others may change.

Only regular files of a bounded size are read; links, devices and pipes count as missing. A file is written
under a new name that only its owner can open, and then renamed: it is there whole or not at all, and a link
in its place is replaced, not followed.
"""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

#: Prefix of the names of unfinished files; those that a killed process left are ignored.
PART = ".part-"

_CAREFULLY = os.O_RDONLY | sum(
    getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY")
)


def read(path: Path, most: int, *, private: bool = False) -> bytes | None:
    """Return the content of a file, or None where there is no such file."""
    try:
        handle = os.open(path, _CAREFULLY)
    except (OSError, ValueError):
        return None
    try:
        info = os.fstat(handle)
        if not stat.S_ISREG(info.st_mode) or info.st_size > most:
            return None
        if private and writable_by_others(info):
            return None
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(most)
    except OSError:
        return None
    finally:
        os.close(handle)


def replace(path: Path, data: bytes) -> None:
    """Write a file, whole or not at all."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=PART)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def writable_by_others(info: os.stat_result) -> str:
    """Reason why others than this user can write a file or folder; empty if only this user can."""
    if not hasattr(os, "geteuid"):  # a system without owners and modes of this kind
        return ""
    if info.st_uid != os.geteuid():
        return f"it belongs to user {info.st_uid}, not to this one, {os.geteuid()}"
    if info.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"others than its owner can write it (mode {stat.S_IMODE(info.st_mode):04o})"
    return ""
