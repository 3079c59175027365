"""Rows of numbers in an archive, written and read within bounds.

The archive is NumPy's ``.npz`` with one row for each type of number and a text, ``tree``. The text is not
compressed, so that it is no larger than the file; the rows together are at most 256 MiB or a hundred
times as large as the file.
"""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Mapping
from typing import Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.typing import NDArray

#: Bytes of all rows: so many, or so many times the size of the file.
_ALWAYS, _TIMES = 1 << 28, 100

#: Bytes of the header of a row.
_HEADER = 1 << 10

_TREE = "tree"
_TYPES = {
    np.dtype(kind).name: np.dtype(kind)
    for kind in (np.bool_, *np.typecodes["AllInteger"], *"efdFD")
}


def packed(tree: bytes, rows: Mapping[str, NDArray[Any]]) -> bytes:
    """Return an archive of a text and of rows by the name of their type."""
    data = _packed(tree, rows, ZIP_DEFLATED)
    if sum(row.nbytes + _HEADER for row in rows.values()) > _bound(len(data)):
        data = _packed(tree, rows, ZIP_STORED)
    return data


def _packed(tree: bytes, rows: Mapping[str, NDArray[Any]], method: int) -> bytes:
    memory = io.BytesIO()
    with ZipFile(memory, "w", ZIP_STORED) as archive:
        for name, row in {_TREE: np.frombuffer(tree, np.uint8), **rows}.items():
            part = ZipInfo(f"{name}.npy")
            part.compress_type = ZIP_STORED if name == _TREE else method
            with archive.open(part, "w", force_zip64=True) as file:
                np.lib.format.write_array(file, row, version=(1, 0), allow_pickle=False)
    return memory.getvalue()


def unpacked(path: str | os.PathLike[str]) -> tuple[bytes, dict[str, NDArray[Any]]]:
    """Read the text and the rows of an archive; ValueError, OSError or an error of ``zipfile``."""
    with open(path, "rb", opener=_regular) as file:
        size = os.fstat(file.fileno()).st_size
        with ZipFile(file) as archive:
            parts = {part.filename: part for part in archive.infolist()}
            known = {f"{name}.npy" for name in (_TREE, *_TYPES)}
            if len(parts) != len(archive.infolist()) or not {*parts} <= known:
                raise ValueError("it has other parts than results have")
            if f"{_TREE}.npy" not in parts:
                raise ValueError("it has no tree")
            if parts[f"{_TREE}.npy"].compress_type != ZIP_STORED:
                raise ValueError("its tree is compressed, as in files of another version")
            total = sum(part.file_size for part in parts.values())
            if total > _bound(size) + size:
                raise ValueError(
                    f"it holds {total} bytes, more than the limit of {_bound(size) + size} for its size"
                )
            rows = {name.removesuffix(".npy"): _row(archive, parts[name]) for name in parts}
    return rows.pop(_TREE).tobytes(), rows


def _bound(size: int) -> int:
    return max(_ALWAYS, _TIMES * size)


def _regular(path: str, flags: int) -> int:
    """Open a file that is none but a regular one: a pipe or a device may never end."""
    handle = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise OSError("it is no regular file")
    return handle


def _row(archive: ZipFile, part: ZipInfo) -> NDArray[Any]:
    name = part.filename.removesuffix(".npy")
    kind = np.dtype(np.uint8) if name == _TREE else _TYPES[name]
    with archive.open(part) as file:
        raw = file.read(part.file_size + 1)
    stream = io.BytesIO(raw)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise ValueError(f"its array {name} has another version")
    shape, _, found = np.lib.format.read_array_header_1_0(stream)
    content = memoryview(raw)[stream.tell() :]
    if found != kind or len(shape) != 1 or len(content) != shape[0] * kind.itemsize:
        raise ValueError(f"its array {name} has another type or size")
    return np.frombuffer(content, kind)
