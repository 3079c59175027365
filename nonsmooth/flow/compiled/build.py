"""From C source to a loaded library: find a compiler, compile once, keep the result.

The cache key hashes the source, the flags, the compiler's path and version, and the processor, so
a change of any of them is another entry. Entries appear by an atomic rename: processes that build
the same one at once do double work and no harm. An entry carries a hash of itself; one that does not
match, or does not load, is built again.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from functools import lru_cache
from pathlib import Path

from ...model import NonsmoothError

#: No -ffast-math: reassociation and assumed finiteness give wrong itineraries.
FLAGS = (
    "-O2 -march=native -std=gnu11 -fPIC -shared -fno-math-errno -fno-trapping-math "
    "-ffp-contract=fast -w"
).split()

ADVICE = (
    "Install one (gcc or clang from the system, or `pip install nonsmooth-dynamics[compiler]`), or "
    "set CC."
)


class CompilerError(NonsmoothError, RuntimeError):
    """No compiler was found, or it failed; the message holds the command and the file."""


@lru_cache(maxsize=8)
def _locate(cc: str, path: str) -> tuple[str, ...] | None:
    if cc and shutil.which(shlex.split(cc)[0], path=path):
        return tuple(shlex.split(cc))
    for name in ("cc", "gcc", "clang"):
        found = shutil.which(name, path=path)
        if found:
            return (found,)
    if importlib.util.find_spec("ziglang") is not None:
        return (sys.executable, "-m", "ziglang", "cc")
    return None


def find_compiler() -> tuple[str, ...] | None:
    """Command of the C compiler: $CC, cc, gcc, clang, or the ziglang wheel; None without any."""
    return _locate(os.environ.get("CC", ""), os.environ.get("PATH", ""))


@lru_cache(maxsize=8)
def _compiler_version(command: tuple[str, ...]) -> str:
    """Identify a compiler without running it where its file says enough (running costs 10 ms)."""
    path = shutil.which(command[0]) or command[0]
    if len(command) > 1:
        spec = importlib.util.find_spec("ziglang")
        path = spec.origin if spec is not None and spec.origin else path
    real = os.path.realpath(path)
    try:
        stat = os.stat(real)
    except OSError:
        return real
    return f"{shlex.join(command)} {real} {stat.st_size} {stat.st_mtime_ns}"


@lru_cache(maxsize=1)
def _processor() -> str:
    """What -march=native depends on."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").split("\n\n")[0].splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()} {platform.version()}"
    keys = ("model name", "flags", "features", "cpu family", "model", "stepping")
    return platform.machine() + "".join(
        line for line in lines if line.split(":")[0].strip().lower() in keys
    )


def lane_width() -> int:
    """Doubles in a vector register, and at least 4: wider vectors than the processor's are slow."""
    return 8 if "avx512f" in _processor().split() else 4


def cache_directory() -> Path:
    """Folder of compiled engines: $NONSMOOTH_CACHE, or the user's cache folder."""
    explicit = os.environ.get("NONSMOOTH_CACHE")
    if explicit:
        return Path(explicit)
    if sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "nonsmooth"


def _writable_cache() -> Path:
    folder = cache_directory()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return _private_folder()


@lru_cache(maxsize=1)
def _private_folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="nonsmooth-"))


def library_key(source: str, command: tuple[str, ...]) -> str:
    """Content hash of a build."""
    parts = (source, " ".join(FLAGS), _compiler_version(command), _processor(), sys.platform)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def build(source: str) -> ctypes.CDLL:
    """Load the library of a C source, compiled unless the cache has it.

    Raises
    ------
    CompilerError
    """
    command = find_compiler()
    if command is None:
        raise CompilerError(f"compiler: expected a C compiler, found none. {ADVICE}")
    folder = _writable_cache()
    library = folder / f"{library_key(source, command)}.so"
    for attempt in (1, 2):
        if not _intact(library):
            _compile(source, command, library)
        try:
            return ctypes.CDLL(str(library))
        except OSError as error:
            if attempt == 2:
                raise CompilerError(
                    f"library {library}: compiled but does not load ({error}). "
                    "Is it built for another machine, or the folder mounted noexec? Set "
                    "NONSMOOTH_CACHE to another folder."
                ) from error
            library.unlink(missing_ok=True)
    raise AssertionError


def _digest(data: bytes) -> bytes:
    return b"nonsmooth" + hashlib.sha256(data).digest()


def _intact(library: Path) -> bool:
    """Whether a cache entry ends in the hash of what comes before (a linker ignores the tail)."""
    try:
        data = library.read_bytes()
    except OSError:
        return False
    return len(data) > 41 and data[-41:] == _digest(data[:-41])


def _compile(source: str, command: tuple[str, ...], library: Path) -> None:
    with tempfile.TemporaryDirectory(dir=library.parent, prefix="build-") as work:
        text, output = Path(work) / "engine.c", Path(work) / "engine.so"
        text.write_text(source, encoding="utf-8")
        call = [*command, *FLAGS, str(text), "-o", str(output), "-lm"]
        try:
            done = subprocess.run(call, capture_output=True, text=True, errors="replace")
            failure = done.stderr if done.returncode else ""
        except OSError as error:
            failure = str(error)
        if failure or not output.exists():
            kept = library.with_suffix(".c")
            kept.write_text(source, encoding="utf-8")
            raise CompilerError(
                f"compiler: expected a library from\n  {shlex.join(call)}\nreceived\n"
                f"{failure.strip()[:2000]}\nThe source is kept in {kept}. {ADVICE}"
            )
        with output.open("ab") as file:
            data = output.read_bytes()
            file.write(_digest(data))
        os.replace(output, library)
