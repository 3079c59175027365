"""Files in folders that others may have touched: read with care, written whole.

A file is read only if it is a regular one of a bounded size; a link, a device or a pipe in its place
is as good as none. It is written under a new name, made exclusively and for its owner alone, and
then renamed, so that it is there whole or not at all and a link in its place is replaced, not
followed.
"""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

#: How names of files under way begin; one that a killed process left behind means nothing.
PART = ".part-"

_CAREFULLY = os.O_RDONLY | sum(
    getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY")
)


def read(path: Path, most: int, *, private: bool = False) -> bytes | None:
    """Return what a file holds, or None where there is no such file."""
    try:
        handle = os.open(path, _CAREFULLY)
    except (OSError, ValueError):
        return None
    try:
        facts = os.fstat(handle)
        if not stat.S_ISREG(facts.st_mode) or facts.st_size > most:
            return None
        if private and fault(facts):
            return None
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(most)
    except OSError:
        return None
    finally:
        os.close(handle)


def replace(path: Path, data: bytes) -> None:
    """Write a file at once."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=PART)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def fault(facts: os.stat_result) -> str:
    """Why a file or folder is not this user's alone to write; empty where it is."""
    if not hasattr(os, "geteuid"):  # a system without owners and modes of this kind
        return ""
    if facts.st_uid != os.geteuid():
        return f"it belongs to user {facts.st_uid}, not to this one, {os.geteuid()}"
    if facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"others than its owner can write it (mode {stat.S_IMODE(facts.st_mode):04o})"
    return ""
