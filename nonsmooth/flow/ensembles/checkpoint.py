"""Finished chunks of an ensemble in a folder, so that an interrupted sweep goes on where it was.

The folder holds ``problem.json`` (a hash of system, starts, parameters and options, and the size of
a chunk) and one ``.npz`` file for each finished chunk. Each is sealed with a hash of all that is in
it and of what it belongs to. A chunk that is damaged, that was changed by hand or that comes from
another problem or place counts as not finished and is computed again; a damaged ``problem.json``
is refused. The seal finds accidents; it is no signature against one who knows how it is made.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile

import numpy as np
from numpy.typing import NDArray

from ...model import OptionError, explain
from .. import files
from ..results import Chunk
from ..status import Status

#: Raised whenever the files or the numbers in them change, so that versions are not mixed.
_FORMAT = 4

#: Bytes: of problem.json, of the itineraries of a chunk, of a header of an array in a file.
_HEAD, _WORDS, _HEADER = 1 << 12, 1 << 30, 1 << 10


class Checkpoint:
    """Chunks on disk.

    Parameters
    ----------
    path : path-like
        A folder; made if it is not there.
    problem : str
        Hash of everything the results depend on.
    chunk : callable
        Returns the size of a chunk, if the folder has none.

    Raises
    ------
    OptionError
        The folder belongs to another problem, is no checkpoint, is damaged or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], problem: str, chunk: Callable[[], int]):
        self.folder, self.problem = Path(path), problem
        head = self.folder / "problem.json"
        try:
            if os.path.lexists(head):
                self.chunk = self._check(head)
                return
            if os.path.lexists(self.folder) and self._holds_something():
                raise OptionError(
                    f"checkpoint: expected a new folder or one written by ensemble, received "
                    f"{self.folder}, which holds something else. Choose another path."
                )
            self.folder.mkdir(parents=True, exist_ok=True)
            self.chunk = chunk()
            files.replace(head, json.dumps(_sealed(self._head(self.chunk))).encode())
        except (OSError, ValueError) as error:
            if isinstance(error, OptionError):
                raise
            raise self._unusable(error) from error

    def _head(self, chunk: int) -> dict[str, Any]:
        return {"format": _FORMAT, "problem": self.problem, "chunk": chunk}

    def _holds_something(self) -> bool:
        if not self.folder.is_dir():
            return True
        return any(not p.name.startswith(files.PART) for p in self.folder.iterdir())

    def _unusable(self, error: Exception) -> OptionError:
        return OptionError(
            explain(
                "checkpoint",
                expected="a folder that can be read and written",
                received=f"{str(self.folder)!r} ({error})",
                advice="Finished chunks in it are kept. Make room or choose another path.",
            )
        )

    def _check(self, head: Path) -> int:
        """Size of a chunk according to the folder, which must be this problem's."""
        try:
            content = json.loads(files.read(head, _HEAD) or b"")
            own = {name: content[name] for name in ("format", "problem", "chunk")}
            whole = content == _sealed(own) and type(own["chunk"]) is int
            whole = whole and 0 < own["chunk"] < 1 << 62  # NumPy's indices end there
        except (ValueError, KeyError, TypeError, RecursionError):
            own, whole = {}, False
        if own.get("format", _FORMAT) == _FORMAT and not whole:
            raise OptionError(
                f"checkpoint: expected the file that ensemble wrote, received {head}, which is "
                f"damaged or was changed. Choose another path, or delete {self.folder}."
            )
        if own != self._head(own["chunk"]):
            raise OptionError(
                f"checkpoint: expected one of this problem, received {self.folder}, written for "
                "another system, start, parameter or option, or by another version. Choose another "
                "path, or delete it."
            )
        return own["chunk"]

    def load(self, number: int, like: Chunk) -> Chunk | None:
        """Return a finished chunk, or None; a damaged file counts as not finished.

        Parameters
        ----------
        number : int
        like : Chunk
            Has arrays as the chunk's must be; what is in them does not matter.
        """
        expected = chunk_arrays(like)
        most = sum(a.nbytes + 2 * _HEADER for a in expected.values()) + _WORDS
        data = files.read(self._file(number), most)
        if data is None:
            return None
        try:
            arrays = _unpacked(data, expected)
            words = json.loads(arrays.pop("words").tobytes())
            seal = arrays.pop("seal").tobytes()
            if seal != self._seal(number, words, arrays) or not _valid(words, arrays):
                return None
        except Exception:  # whatever a damaged file drives the readers of zip, NumPy and JSON to
            return None
        return replace(like, **arrays, words=words)

    def save(self, number: int, chunk: Chunk) -> None:
        """Write a finished chunk.

        Raises
        ------
        OptionError
            It cannot be written; those that were finished before are kept.
        """
        arrays, memory = chunk_arrays(chunk), io.BytesIO()
        words = np.frombuffer(json.dumps(chunk.words).encode(), np.uint8)
        seal = np.frombuffer(self._seal(number, chunk.words, arrays), np.uint8)
        parts: dict[str, Any] = {**arrays, "words": words, "seal": seal}
        np.savez(memory, **parts)
        try:
            files.replace(self._file(number), memory.getvalue())
        except OSError as error:
            raise self._unusable(error) from error

    def _file(self, number: int) -> Path:
        return self.folder / f"chunk-{number:08d}.npz"

    def _seal(self, number: int, words: list[str], arrays: dict[str, NDArray[Any]]) -> bytes:
        place = [self.problem, self.chunk, number]
        code = hashlib.sha256(json.dumps([_FORMAT, place, words]).encode())
        for name, array in sorted(arrays.items()):
            code.update(f"{name} {array.dtype.str} {array.shape}".encode())
            code.update(np.ascontiguousarray(array).tobytes())
        return code.digest()


def _sealed(content: dict[str, Any]) -> dict[str, Any]:
    text = json.dumps(content, sort_keys=True).encode()
    return {**content, "seal": hashlib.sha256(text).hexdigest()}


def chunk_arrays(chunk: Chunk) -> dict[str, NDArray[Any]]:
    """Return all numbers of a chunk, by name."""
    return {**chunk.arrays(), "totals": chunk.totals}


def _unpacked(data: bytes, expected: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Arrays of a file; ValueError unless they have the types and shapes expected."""
    # Nothing is made larger than the file: its parts are not compressed, and an array that says that it
    # is of another size than it has to be is not read.
    arrays: dict[str, NDArray[Any]] = {}
    with ZipFile(io.BytesIO(data)) as file:
        parts = {part.filename: part for part in file.infolist()}
        if set(parts) != {f"{name}.npy" for name in (*expected, "words", "seal")}:
            raise ValueError("other arrays")
        for name, part in parts.items():
            if part.compress_type != ZIP_STORED or part.file_size > len(data):
                raise ValueError("compressed")
            raw = file.read(part)
            stream = io.BytesIO(raw)
            if np.lib.format.read_magic(stream) != (1, 0):
                raise ValueError("another version")
            found = np.lib.format.read_array_header_1_0(stream)
            content, wanted = raw[stream.tell() :], expected.get(name.removesuffix(".npy"))
            if wanted is None:
                wanted = np.empty(len(content), np.uint8)
            if found != (wanted.shape, False, wanted.dtype):
                raise ValueError("another shape or type")
            array = np.frombuffer(content, wanted.dtype).reshape(wanted.shape)
            arrays[name.removesuffix(".npy")] = array
    return arrays


def _valid(words: list[str], arrays: dict[str, NDArray[Any]]) -> bool:
    """Whether a chunk is one that a run could have had."""
    code, known = arrays["itinerary"], [int(s) for s in Status]
    return (
        words == sorted(set(words))
        and all(isinstance(w, str) for w in words)
        and bool(np.all((code >= 0) & (code < len(words))))
        and bool(np.isin(arrays["status"], known).all())
        and bool(np.all(arrays["kinds"] >= 0))
    )
