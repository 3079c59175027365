"""Results of an ensemble in a folder of arrays instead of memory: a checkpoint that is its own result.

Each array of results is a file of NumPy's (``x.npy``, ``t.npy``, ...) that is mapped into memory, so
that its rows are written as their chunk is finished and read when they are looked at. Beside them is
what a checkpoint has, ``problem.json`` and a file for each finished chunk, with its words and the
seal over its rows.
"""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model import OptionError, explain
from .. import files
from ..results import Chunk
from .checkpoint import Checkpoint, chunk_arrays

try:
    import fcntl
except ImportError:  # a system where no other process can be told of
    fcntl = None  # type: ignore[assignment]

#: How the file that a run holds is opened: made where it is not there, no link followed.
_OPENED = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)

#: Folders that runs of this process write to, and what stands for each run.
_AT_WORK: dict[Path, object] = {}

#: What file systems say that cannot reserve room.
_CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)


class Stored(Checkpoint):
    """Chunks whose rows are in mapped arrays."""

    def __init__(self, path: str | os.PathLike[str], problem: str, chunk: Callable[[], int]):
        super().__init__(path, f"stored {problem}", chunk)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the folder for one run, since two would write to the same rows."""
        # The system lets it go when the process ends, in whatever way.
        folder, own = self.folder.resolve(), object()
        try:
            if _AT_WORK.setdefault(folder, own) is not own:
                raise self._busy()
            try:
                file = os.fdopen(os.open(folder / ".lock", _OPENED), "w")
            except OSError as error:
                raise self._unusable(error) from error
            with file:
                try:
                    if fcntl is not None:
                        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError as error:
                    if error.errno in (errno.EACCES, errno.EAGAIN):  # others: none can be had there
                        raise self._busy() from error
                yield
        finally:
            if _AT_WORK.get(folder) is own:
                del _AT_WORK[folder]

    def _busy(self) -> OptionError:
        return OptionError(
            explain(
                "store",
                expected="a folder that no other run writes to",
                received=f"{self.folder}, which another run is writing",
                advice="Wait until it has ended, or choose another path.",
            )
        )

    def arrays(self, like: Chunk, count: int) -> Chunk:
        """Return arrays of ``count`` rows in the folder, of the types that the arrays of a chunk
        have."""
        mapped: dict[str, Any] = {
            name: self._map(name, (count, *array.shape[1:]), array.dtype)
            for name, array in like.arrays().items()
        }
        return replace(like, **mapped)

    def codes(self, count: int) -> NDArray[np.int32]:
        """Return the array for the itineraries' numbers over all chunks."""
        return self._map("itinerary_code", (count,), np.dtype(np.int32))

    def _map(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        path = self.folder / f"{name}.npy"
        if not math.prod(shape):
            return np.empty(shape, dtype)  # nothing can be mapped
        try:
            if not os.path.lexists(path):
                _make(path, shape, dtype)
            if path.is_symlink() or not path.is_file():
                raise ValueError("it is no file")
            array = np.load(path, mmap_mode="r+", allow_pickle=False)
            if array.shape != shape or array.dtype != dtype:
                raise ValueError(f"an array of shape {array.shape} and type {array.dtype}")
        except Exception as error:  # whatever a damaged header drives NumPy to
            raise OptionError(
                explain(
                    "store",
                    expected=f"an array of shape {shape} and type {dtype} in {path}",
                    received=str(error),
                    advice=f"Make room, choose another path, or delete {path.name}: what was in it is "
                    "computed again.",
                )
            ) from error
        return np.asarray(array)

    def load(self, number: int, like: Chunk) -> Chunk | None:
        """Return a finished chunk, whose rows are those of ``like``, or None."""
        data = files.read(self._file(number), 1 << 30)
        try:
            content = json.loads(data or b"")
            words, totals = content["words"], np.array(content["totals"], np.int64)
            found = replace(like, words=words, totals=totals)
            whole = content["seal"] == self._seal(number, words, chunk_arrays(found)).hex()
            return found if whole else None
        except Exception:  # whatever a damaged file drives the reader to
            return None

    def save(self, number: int, chunk: Chunk) -> None:
        """Note that a chunk is finished, whose rows are in the arrays."""
        seal = self._seal(number, chunk.words, chunk_arrays(chunk)).hex()
        content = {"words": chunk.words, "totals": chunk.totals.tolist(), "seal": seal}
        try:
            files.replace(self._file(number), json.dumps(content).encode())
        except OSError as error:
            raise self._unusable(error) from error

    def _file(self, number: int) -> Path:
        return self.folder / f"chunk-{number:08d}.json"


def _make(path: Path, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """A file of zeros, there whole or not at all."""
    part = path.with_name(f"{files.PART}{path.name}")
    try:
        np.lib.format.open_memmap(part, mode="w+", dtype=dtype, shape=shape)
        _reserve(part)
        os.replace(part, path)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def _reserve(path: Path) -> None:
    """Take the room of a file on the disk, where that can be done."""
    # A disk that is full when a row is written to a mapped array would end the process with a signal.
    if not hasattr(os, "posix_fallocate"):
        return
    with path.open("r+b") as file:
        try:
            os.posix_fallocate(file.fileno(), 0, os.fstat(file.fileno()).st_size)
        except OSError as error:
            if error.errno not in _CANNOT_RESERVE:
                raise
