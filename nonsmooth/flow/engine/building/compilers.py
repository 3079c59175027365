"""Available C compilers in order of preference, and the properties that a build depends on."""

from __future__ import annotations

import importlib.util
import os
import platform
import shlex
import shutil
import sys
from functools import lru_cache
from pathlib import Path

from ....model.errors import NonsmoothError, explain

#: No -ffast-math: reassociation and assumed finiteness give wrong itineraries. The code is for any processor of
#: the machine's kind, with the same bits on all.
FLAGS = (
    "-O2 -std=gnu11 -fPIC -shared -fno-math-errno -fno-trapping-math -ffp-contract=off -w"
).split()

ADVICE = (
    "Install one (gcc or clang from the system, or `python -m pip install ziglang`), or set CC."
)

Command = tuple[str, ...]


class CompilerError(NonsmoothError, RuntimeError):
    """No compiler was found, or it failed; the message holds the command and the file."""

    def __init__(self, message: str, brief: str = ""):
        super().__init__(message)
        self.brief = brief


def compilers() -> tuple[Command, ...]:
    """Commands of the C compilers in the order of preference: $CC, cc, gcc, clang, ziglang's."""
    return _located(os.environ.get("CC", ""), os.environ.get("PATH", ""))


def baseline(command: Command) -> tuple[str, ...]:
    """Flags with which a compiler makes code for any processor of the machine's kind."""
    return ("-mcpu=baseline",) if command[1:3] == ("-m", "ziglang") else ()


def find_compiler() -> Command | None:
    """Command of the first C compiler of :func:`compilers`; None without any."""
    return next(iter(compilers()), None)


@lru_cache(maxsize=8)
def _located(cc: str, path: str) -> tuple[Command, ...]:
    found = [command for command in [_named(cc)] if command and shutil.which(command[0], path=path)]
    seen = {os.path.realpath(shutil.which(c[0], path=path) or "") for c in found}
    for name in ("cc", "gcc", "clang"):
        place = shutil.which(name, path=path)
        if place and (real := os.path.realpath(place)) not in seen:
            seen.add(real)
            found.append((place,))
    if importlib.util.find_spec("ziglang") is not None:
        found.append((sys.executable, "-m", "ziglang", "cc"))
    return tuple(found)


def _named(cc: str) -> Command:
    """Words of CC; none if it is not set."""
    try:
        words = tuple(shlex.split(cc))
    except ValueError as error:
        raise _no_command(cc, f" ({error})") from None
    if cc and not (words and words[0]):
        raise _no_command(cc, "")
    return words


def _no_command(cc: str, why: str) -> CompilerError:
    return CompilerError(
        explain(
            "CC",
            expected="a command such as gcc or 'clang -m64'",
            received=f"{cc!r}{why}",
            advice="Correct or unset this environment variable.",
        )
    )


@lru_cache(maxsize=8)
def version(command: Command) -> str:
    """Identify a compiler without running it where its file says enough (running costs 10 ms)."""
    path = shutil.which(command[0]) or command[0]
    if command[1:3] == ("-m", "ziglang"):
        spec = importlib.util.find_spec("ziglang")
        path = spec.origin if spec is not None and spec.origin else path
    real = os.path.realpath(path)
    try:
        stat = os.stat(real)
    except OSError:
        return real
    return f"{shlex.join(command)} {real} {stat.st_size} {stat.st_mtime_ns}"


@lru_cache(maxsize=1)
def processor() -> str:
    """Identify the processor for -march=native."""
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
    return 8 if "avx512f" in processor().split() else 4
