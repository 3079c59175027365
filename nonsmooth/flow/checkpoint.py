"""Finished chunks of an ensemble in a folder, so that an interrupted sweep goes on where it was.

The folder holds ``problem.json`` (a hash of system, starts, parameters and options, and the size of
a chunk) and one ``.npz`` file for each finished chunk. Files appear by an atomic rename.
"""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from ..model import OptionError
from .results import Chunk

#: Raised whenever the files or the numbers in them change, so that versions are not mixed.
_FORMAT = 2
_ARRAYS = ("x", "t", "status", "itinerary", "kinds", "at_x", "at_t", "totals")


class Checkpoint:
    """Chunks on disk.

    Parameters
    ----------
    path : path-like
        A folder; made if it is not there.
    problem : str
        Hash of everything the results depend on.
    chunk : int
        Size of a chunk, unless the folder has one.

    Raises
    ------
    OptionError
        The folder belongs to another problem or is no checkpoint.
    """

    def __init__(self, path: str | os.PathLike[str], problem: str, chunk: int):
        self.folder, self.chunk = Path(path), chunk
        head = self.folder / "problem.json"
        if head.exists():
            self.chunk = self._check(head, problem)
            return
        if self.folder.exists() and (not self.folder.is_dir() or any(self.folder.iterdir())):
            raise OptionError(
                f"checkpoint: expected a new folder or one written by ensemble, received "
                f"{self.folder}, which holds something else. Choose another path."
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        content = {"format": _FORMAT, "problem": problem, "chunk": chunk}
        self._write(head, json.dumps(content).encode())

    def _check(self, head: Path, problem: str) -> int:
        try:
            content = json.loads(head.read_text(encoding="utf-8"))
            same = content["problem"] == problem and content["format"] == _FORMAT
            chunk = int(content["chunk"])
        except (ValueError, KeyError, TypeError):
            same, chunk = False, 0
        if not same:
            raise OptionError(
                f"checkpoint: expected one of this problem, received {self.folder}, written for "
                "another system, start, parameter or option. Choose another path, or delete it."
            )
        return chunk

    def load(self, number: int) -> Chunk | None:
        """Return a finished chunk, or None; a damaged file counts as not finished."""
        try:
            with np.load(self._file(number), allow_pickle=False) as data:
                arrays = {k: data[k] if k in data else None for k in _ARRAYS}
                words = json.loads(str(data["words"]))
        except (OSError, ValueError, KeyError, EOFError, BadZipFile):
            return None
        return Chunk(words=words, **arrays)  # type: ignore[arg-type]

    def save(self, number: int, chunk: Chunk) -> None:
        """Write a finished chunk."""
        arrays = {k: v for k in _ARRAYS if (v := getattr(chunk, k)) is not None}
        handle, name = tempfile.mkstemp(dir=self.folder, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            np.savez(file, words=np.array(json.dumps(chunk.words)), **arrays)
        os.replace(name, self._file(number))

    def _file(self, number: int) -> Path:
        return self.folder / f"chunk-{number:08d}.npz"

    def _write(self, target: Path, data: bytes) -> None:
        handle, name = tempfile.mkstemp(dir=self.folder, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.replace(name, target)
