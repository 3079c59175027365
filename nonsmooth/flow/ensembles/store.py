"""Results of an ensemble in a folder, mapped into memory, so that an interrupted sweep can continue.

``problem.json`` holds a hash of system, starts, parameters and options, and the size of a chunk. Each
array of results is a NumPy file (``x.npy``, ``t.npy``, ...), filled row by row. A note for each finished
chunk holds its itineraries and a hash of its rows: rows that were damaged or changed are computed again.
The hash finds accidents; it is no signature.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...model import OptionError
from ..results import Chunk
from ..saving import files

try:
    import fcntl
except ImportError:  # a system without locks of files: runs of other processes are not noticed
    fcntl = None  # type: ignore[assignment]

#: Raised whenever the files or the numbers in them change, so that versions are not mixed.
_FORMAT = 5

#: Largest sizes in bytes of problem.json and of the note of a chunk.
_PROBLEM, _NOTE = 1 << 12, 1 << 30

#: The file that a run locks, and how it is opened: made where it is missing, no link followed.
_LOCK = ".lock"
_OPENED = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)

#: Folders that runs of this process write to, and an object for each run.
_AT_WORK: dict[Path, object] = {}

#: Errors of file systems that cannot reserve room.
_CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)


class Store:
    """Arrays of results on disk and a note for each finished chunk, for one run at a time."""

    def __init__(self, path: str | os.PathLike[str], problem: str):
        self.folder, self.problem, self.chunk = Path(path), problem, 0
        self._mode: Literal["r+", "c"] = "r+"

    @contextmanager
    def opened(self, size: Callable[[], int]) -> Iterator[None]:
        """Check or make the folder and lock it; ``size`` gives the chunk size of a new one."""
        head = self.folder / "problem.json"
        if not os.path.lexists(head):
            self._make()
        elif not os.access(self.folder, os.W_OK):  # nothing is written, so no lock is needed
            self._mode, self.chunk = "c", self._checked(head)
            yield
            return
        with self._locked(self.folder.resolve()):
            if os.path.lexists(head):
                self.chunk = self._checked(head)
            else:
                self.chunk = size()
                self._write(head, _sealed(self._head(self.chunk)))
            yield

    def _make(self) -> None:
        """Make the folder; one that is there must be empty but for what a killed run left."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            names = [path.name for path in self.folder.iterdir()]
        except (OSError, ValueError) as error:
            raise self._unusable(error) from error
        unknown = [name for name in names if not name.startswith((files.PART, _LOCK))]
        if unknown and "problem.json" not in unknown:  # which another run may have just written
            raise self._refused("holds other files than the results of an ensemble")

    @contextmanager
    def _locked(self, folder: Path) -> Iterator[None]:
        """Lock the folder for one run, since two would write to the same rows."""
        # The system releases the lock when the process ends, in whatever way.
        own = object()
        busy = self._refused("is being written by another run", "Wait until that has ended, or use")
        try:
            if _AT_WORK.setdefault(folder, own) is not own:
                raise busy
            try:
                file = os.fdopen(os.open(folder / _LOCK, _OPENED), "w")
            except OSError as error:
                raise self._unusable(error) from error
            with file:
                try:
                    if fcntl is not None:
                        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError as error:
                    if error.errno in (errno.EACCES, errno.EAGAIN):  # others: no locks there
                        raise busy from error
                yield
        finally:
            if _AT_WORK.get(folder) is own:
                del _AT_WORK[folder]

    def _head(self, chunk: int) -> dict[str, Any]:
        return {"format": _FORMAT, "problem": self.problem, "chunk": chunk}

    def _checked(self, head: Path) -> int:
        """Size of a chunk in the folder, which must be of this problem."""
        try:
            content = json.loads(files.read(head, _PROBLEM) or b"")
            own = {name: content[name] for name in ("format", "problem", "chunk")}
            whole = content == _sealed(own) and type(own["chunk"]) is int
            whole = whole and 0 < own["chunk"] < 1 << 62  # NumPy's indices end there
        except (ValueError, KeyError, TypeError, RecursionError):
            own, whole = {}, False
        if own.get("format", _FORMAT) == _FORMAT and not whole:
            raise self._refused("has a damaged problem.json", f"Delete {self.folder}, or use")
        if own != self._head(own["chunk"]):
            raise self._refused(
                "was written for another system, start, parameter or option, or by another version",
                "Delete it, or use",
            )
        return own["chunk"]

    def arrays(self, like: Chunk, count: int) -> Chunk:
        """Mapped arrays of ``count`` rows, of the types of the arrays of a chunk."""
        mapped: dict[str, Any] = {
            name: self._map(name, (count, *array.shape[1:]), array.dtype)
            for name, array in like.arrays().items()
        }
        return replace(like, **mapped)

    def codes(self, count: int) -> NDArray[np.int32]:
        """Mapped array for the numbers of the itineraries over all chunks."""
        return self._map("itinerary_code", (count,), np.dtype(np.int32))

    def _map(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        path = self.folder / f"{name}.npy"
        if not math.prod(shape):
            return np.empty(shape, dtype)  # an empty file cannot be mapped
        try:
            if not os.path.lexists(path):
                _make_array(path, shape, dtype)
            if path.is_symlink() or not path.is_file():
                raise ValueError("it is no file")
            size = path.stat().st_size
            array = np.load(path, mmap_mode=self._mode, allow_pickle=False)
            if path.stat().st_size > size:  # the file was cut, and mapping it made it longer
                _reserve(path)
            if array.shape != shape or array.dtype != dtype:
                raise ValueError(f"it has shape {array.shape} and type {array.dtype}")
        except Exception as error:  # whatever a damaged header raises in NumPy's reader
            raise self._refused(
                f"has no array {name}.npy of shape {shape} and type {dtype} ({error})",
                f"Make room, delete {name}.npy, whose rows are computed again, or use",
            ) from error
        return np.asarray(array)

    def load(self, number: int, like: Chunk) -> Chunk | None:
        """Return a finished chunk, whose rows are those of ``like``, or None."""
        try:
            content = json.loads(files.read(self._note(number), _NOTE) or b"")
            words, totals = content["words"], np.array(content["totals"], np.int64)
            found = replace(like, words=words, totals=totals)
            return found if content["seal"] == self._seal(number, found) else None
        except Exception:  # whatever a damaged file raises in its readers
            return None

    def save(self, number: int, chunk: Chunk) -> None:
        """Note that a chunk is finished, whose rows are in the arrays."""
        totals, seal = chunk.totals.tolist(), self._seal(number, chunk)
        self._write(self._note(number), {"words": chunk.words, "totals": totals, "seal": seal})

    def _note(self, number: int) -> Path:
        return self.folder / f"chunk-{number:08d}.json"

    def _write(self, path: Path, content: dict[str, Any]) -> None:
        try:
            files.replace(path, json.dumps(content).encode())
        except OSError as error:
            raise self._unusable(error) from error

    def _seal(self, number: int, chunk: Chunk) -> str:
        place = [self.problem, self.chunk, number]
        code = hashlib.sha256(json.dumps([_FORMAT, place, chunk.words]).encode())
        for name, array in sorted({**chunk.arrays(), "totals": chunk.totals}.items()):
            code.update(f"{name} {array.dtype.str} {array.shape}".encode())
            code.update(np.ascontiguousarray(array).data)
        return code.hexdigest()

    def _unusable(self, error: Exception) -> OptionError:
        return self._refused(
            f"cannot be read and written ({error})",
            "Finished chunks in it are kept. Make room, or use",
        )

    def _refused(self, wrong: str, advice: str = "Choose") -> OptionError:
        return OptionError(f"store {str(self.folder)!r} {wrong}. {advice} another folder.")


def _sealed(content: dict[str, Any]) -> dict[str, Any]:
    text = json.dumps(content, sort_keys=True).encode()
    return {**content, "seal": hashlib.sha256(text).hexdigest()}


def _make_array(path: Path, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Make a file of zeros, whole or not at all."""
    part = path.with_name(f"{files.PART}{path.name}")
    try:
        np.lib.format.open_memmap(part, mode="w+", dtype=dtype, shape=shape)
        _reserve(part)
        os.replace(part, path)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def _reserve(path: Path) -> None:
    """Reserve the room of a file on the disk, where that is possible."""
    # A disk that is full when a row is written to a mapped array would end the process with a signal.
    if not hasattr(os, "posix_fallocate"):
        return
    with path.open("r+b") as file:
        try:
            os.posix_fallocate(file.fileno(), 0, os.fstat(file.fileno()).st_size)
        except OSError as error:
            if error.errno not in _CANNOT_RESERVE:
                raise
