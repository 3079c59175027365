"""From C source to a loaded library: compile once, keep the result, load it.

The key of an entry hashes the source, the flags, the compiler's path and version, and the processor,
so a change of any of them is another entry. Entries appear by an atomic rename: processes that build
the same one at once do double work and no harm. An entry that is damaged, or that does not load, is
built again. Where a compiler fails, a warning names it once and the next one is tried.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from ...saving import files
from ...warn import warn_once
from .compilers import (
    ADVICE,
    FLAGS,
    Command,
    CompilerError,
    compilers,
    find_compiler,
    lane_width,
    processor,
    version,
)
from .core_source import keyed
from .store import cache_directory, is_intact, remove_leftovers, sealed, usable_folder

__all__ = [
    "CompilerError",
    "build",
    "cache_directory",
    "compile_library",
    "find_compiler",
    "lane_width",
    "library_key",
]

#: Seconds after which a compilation is announced, and after which it is ended.
_QUIET, _LONGEST = 1.0, 600.0

#: How folders in which a compiler works begin.
_WORK = "build-"

#: Compilers that were ended so; each is waited for once in a process.
_HANGING: set[Command] = set()


def _call(command: Sequence[str]) -> str:
    """Run a compiler and return its error message, or an empty one; a long compilation is announced on stderr."""
    name = "ziglang" if "ziglang" in command[:3] else command[0]
    with tempfile.TemporaryFile() as errors:
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,  # of which all processes can be ended together
            )
        except (OSError, ValueError) as error:
            return str(error)
        with process:
            try:
                _wait(process, name)
            except BaseException:
                _end(process)
                raise
        if not process.returncode:
            return ""
        errors.seek(0)
        text = errors.read().decode(errors="replace").strip()
    return text or f"exit status {process.returncode} without a message"


def library_key(source: str, command: Command, flags: Sequence[str] = ()) -> str:
    """Content hash of a build."""
    parts = (source, " ".join([*FLAGS, *flags]), version(command), processor(), sys.platform)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def build(source: str, flags: Sequence[str] = ()) -> ctypes.CDLL:
    """Load the library of a C source, compiled unless the cache has it."""
    commands = compilers()
    if not commands:
        raise CompilerError(f"No C compiler was found. {ADVICE}")
    failures: list[CompilerError] = []
    for command in commands:
        try:
            library = _library(source, command, usable_folder(), flags)
        except CompilerError as error:
            failures.append(error)
            continue
        if failures:
            warn_once(f"{failures[0].brief or failures[0]} {shlex.join(command)} is used instead.")
        return library
    raise failures[0]


def _library(source: str, command: Command, folder: Path, flags: Sequence[str]) -> ctypes.CDLL:
    key = library_key(source, command, flags)
    library = folder / f"{key}.so"
    if is_intact(library):
        try:
            return _loaded(library, key)
        except OSError:
            pass  # what it was built for is gone since: once more
    compile_library(source, command, library, flags)
    try:
        return _loaded(library, key)
    except OSError as error:
        library.unlink(missing_ok=True)
        raise CompilerError(
            f"library {library}: compiled by {shlex.join(command)} but does not load ({error}). "
            "If its folder is mounted noexec, set NONSMOOTH_CACHE to another one. Else this compiler is "
            f"at fault, and another one is needed. {ADVICE}",
            f"compiler: what {shlex.join(command)} makes does not load.",
        ) from error


def _loaded(library: Path, key: str) -> ctypes.CDLL:
    """Load a library; OSError if that fails or if it is not the one of this key."""
    loaded = ctypes.CDLL(str(library))
    if not has_key(loaded, key):
        raise OSError("it is not the library of this source")
    return loaded


def has_key(loaded: ctypes.CDLL, key: str) -> bool:
    """Whether a library was compiled with a key."""
    try:
        return (ctypes.c_char * (len(key) + 1)).in_dll(
            loaded, "nonsmooth_key"
        ).value == key.encode()
    except ValueError:
        return False


def compile_library(
    source: str, command: Command, library: Path, flags: Sequence[str] = ()
) -> None:
    """Put the library of a source into its place, which has its key as name."""
    try:
        _compile(source, command, flags, library)
    except OSError as error:
        raise CompilerError(
            f"cache: expected to write {library}, received {error}. Make room, or set "
            "NONSMOOTH_CACHE to another folder."
        ) from error


def _compile(source: str, command: Command, flags: Sequence[str], library: Path) -> None:
    remove_leftovers(library.parent, [_WORK, files.PART], 6 * _LONGEST)
    # No TemporaryDirectory: it would go before the compiler does where a program ends meanwhile.
    work = Path(tempfile.mkdtemp(dir=library.parent, prefix=_WORK))
    try:
        text, output = work / "engine.c", work / "engine.so"
        text.write_text(keyed(source, library.stem), encoding="utf-8")
        call = [*command, *FLAGS, *flags, str(text), "-o", str(output), "-lm"]
        failure = f"no end within {_LONGEST:g} s"
        if command not in _HANGING:
            try:
                failure = _call(call)
            except subprocess.TimeoutExpired:
                _HANGING.add(command)
        if not failure and not output.is_file():
            failure = "no error, but no library either"
        if failure:
            kept = library.with_suffix(".c")
            files.replace(kept, source.encode())
            raise CompilerError(
                f"compiler: expected a library from\n  {shlex.join(call)}\nreceived\n"
                f"{failure[:2000]}\nThe source is kept in {kept}. {ADVICE}",
                f"compiler: {shlex.join(command)} failed ({failure.splitlines()[0][:200]}).",
            )
        files.replace(library, sealed(library.name, output.read_bytes()))
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _wait(process: subprocess.Popen[bytes], name: str) -> None:
    """Wait for a compiler; one that takes long is named on stderr."""
    try:
        _poll(process, _QUIET)
        return
    except subprocess.TimeoutExpired:
        _say(f"nonsmooth: compiling a fast engine with {name} (once; it is kept) ... ")
    try:
        _poll(process, _LONGEST)
    finally:
        _say("done\n" if process.returncode == 0 else "failed\n")


def _poll(process: subprocess.Popen[bytes], seconds: float) -> None:
    """Wait for the end of a process; ``Popen.wait`` would delay Ctrl-C by 0.25 s."""
    end = time.monotonic() + seconds
    while process.poll() is None:
        if time.monotonic() > end:
            raise subprocess.TimeoutExpired(process.args, seconds)
        time.sleep(0.005)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a compiler and what it has started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except (OSError, AttributeError):
        process.kill()


def _say(text: str) -> None:
    """Write to stderr, if there is one."""
    if sys.stderr is not None:
        sys.stderr.write(text)
        sys.stderr.flush()
