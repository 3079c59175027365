"""The folder of compiled libraries: this user's alone, because what is in it is run.

The folder is made with mode 0700. A folder that belongs to another user, that others can write, or that
others could exchange is not used; neither is such an entry, nor one that does not end in its own hash.
If no folder can be used, the process uses a temporary one and warns once.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from ...saving import files
from ...warn import warn_once
from .compilers import CompilerError

#: No library is of this size, in bytes.
_MOST = 1 << 28

_MARK = b"nonsmooth"
_TAIL = len(_MARK) + hashlib.sha256().digest_size


def cache_directory() -> Path:
    """Folder of compiled engines: $NONSMOOTH_CACHE, or the user's cache folder."""
    explicit = os.environ.get("NONSMOOTH_CACHE")
    if explicit:
        return Path(os.path.abspath(os.path.expanduser(explicit)))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "nonsmooth"
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "nonsmooth"


def usable_folder() -> Path:
    """Return the folder of compiled engines, or the process' own where that one cannot be used."""
    try:
        folder = _made(cache_directory())
        why = _unsafe(folder) or _unwritable(folder)
    except (OSError, ValueError, RuntimeError) as error:
        folder, why = Path(), str(error)
    if not why:
        return folder
    named = os.environ.get("NONSMOOTH_CACHE") or "the user's cache folder"
    warn_once(
        f"cache: expected a folder that this user alone can write, received {named}: {why}. Compiled "
        "engines are kept for this process only; set NONSMOOTH_CACHE to a folder of mode 0700."
    )
    return _own_folder()


def _made(folder: Path) -> Path:
    """The folder, with its links followed; made if it is not there, with those above it."""
    missing = []
    while not os.path.lexists(folder):
        missing.append(folder.name)
        folder = folder.parent
    folder = folder.resolve(strict=True)
    for name in reversed(missing):
        folder = folder / name
        try:
            folder.mkdir(mode=0o700)
        except FileExistsError:  # made by another process meanwhile
            pass
    return folder


def _unsafe(folder: Path) -> str:
    """Why a folder is not safe, or empty."""
    info = os.lstat(folder)
    if not stat.S_ISDIR(info.st_mode):
        return f"{folder} is no folder"
    why = files.writable_by_others(info)
    if why and info.st_uid == getattr(os, "geteuid", int)() and _is_ours(folder):
        folder.chmod(0o700)  # of an earlier version, or of a generous umask
        why = ""
    if why:
        return f"{folder}: {why}"
    for above in folder.parents:
        why = _exchangeable(os.lstat(above))
        if why:
            return f"{above}, above {folder}: {why}"
    return ""


def _is_ours(folder: Path) -> bool:
    """Whether the folder has its name from us, so that its mode is ours to set."""
    return not os.environ.get("NONSMOOTH_CACHE") and folder.name == "nonsmooth"


def _exchangeable(info: os.stat_result) -> str:
    """Why others could exchange what is in a folder above ours, or empty."""
    if not hasattr(os, "geteuid"):
        return ""
    if info.st_uid not in (0, os.geteuid(), os.stat("/").st_uid):
        return f"it belongs to user {info.st_uid}"
    writable = info.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    if writable == stat.S_IWGRP and _is_private(info.st_gid):
        writable = 0
    if writable and not info.st_mode & stat.S_ISVTX:
        return f"others can write it (mode {stat.S_IMODE(info.st_mode):04o})"
    return ""


def _is_private(group: int) -> bool:
    """Whether a group has its name from this user and no other members, as some systems make them."""
    import grp  # here: not on every system
    import pwd

    try:
        user, found = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
    except KeyError:
        return False
    return (
        group == user.pw_gid
        and found.gr_name == user.pw_name
        and set(found.gr_mem) <= {user.pw_name}
    )


def _unwritable(folder: Path) -> str:
    """Why libraries cannot be put into a folder and run from there, or empty."""
    if hasattr(os, "ST_NOEXEC") and os.statvfs(folder).f_flag & os.ST_NOEXEC:
        return f"{folder} is mounted noexec"
    try:
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return str(error)


@lru_cache(maxsize=1)
def _own_folder() -> Path:
    try:
        folder = Path(tempfile.mkdtemp(prefix="nonsmooth-")).resolve()
    except OSError as error:
        raise CompilerError(
            f"cache: expected a place for temporary files, received none ({error}). Set TMPDIR or "
            "NONSMOOTH_CACHE to a folder that can be written."
        ) from error
    atexit.register(_remove, folder, os.getpid())
    return folder


def _remove(folder: Path, process: int) -> None:
    if os.getpid() == process:  # not in a child that was forked
        shutil.rmtree(folder, ignore_errors=True)


def remove_leftovers(folder: Path, prefixes: Sequence[str], age: float) -> None:
    """Remove what processes that were killed left in a folder."""
    for found in [path for prefix in prefixes for path in folder.glob(f"{prefix}*")]:
        try:
            if time.time() - os.lstat(found).st_mtime > age:
                shutil.rmtree(found) if found.is_dir() else found.unlink()
        except OSError:
            pass  # another process was faster


def sealed(name: str, data: bytes) -> bytes:
    """Return a library with the hash of its content and name at its end (linkers ignore the tail)."""
    return data + _MARK + hashlib.sha256(name.encode() + b"\0" + data).digest()


def is_intact(library: Path) -> bool:
    """Whether an entry is this user's and ends in its hash, under the name it was made for."""
    data = files.read(library, _MOST, private=True)
    return data is not None and len(data) > _TAIL and sealed(library.name, data[:-_TAIL]) == data
