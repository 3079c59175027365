"""A system as one block of bytes, with the addresses of a machine of 32 bits: what a page gives the driver.

WebAssembly has addresses of 4 bytes. They count from the first byte of the image; who copies it into the
module's memory adds where it is.
"""

from __future__ import annotations

import ctypes
import struct
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from .structures import structure
from .tape import TapeEngine

_POINTER = ctypes.c_void_p


@dataclass(frozen=True)
class Layout:
    """A structure with addresses of 4 bytes: its size and alignment, and of each field the offset and the kind.

    A kind is a code of ``struct``, ``P`` for an address, or the layout of a structure inside.
    """

    size: int
    align: int
    fields: dict[str, tuple[int, str | Layout]]


def layout_of(own: type[ctypes.Structure]) -> Layout:
    """Lay out a structure of ctypes for a machine of 32 bits."""
    at, widest, fields = 0, 1, dict[str, tuple[int, str | Layout]]()
    for name, kind, *_ in own._fields_:
        inner: str | Layout
        if kind is _POINTER:
            size = align = 4
            inner = "P"
        elif issubclass(kind, ctypes.Structure):
            inner = layout_of(kind)
            size, align = inner.size, inner.align
        else:
            size = align = ctypes.sizeof(kind)
            inner = str(cast(Any, kind)._type_)
        at = _up(at, align)
        fields[name] = (at, inner)
        at, widest = at + size, max(widest, align)
    return Layout(_up(at, widest), widest, fields)


def exchanged() -> dict[str, dict[str, Any]]:
    """Layouts of what a page writes for the driver, for JSON."""
    found = {name: layout_of(structure(name)) for name in ("Options", "Batch", "Output")}
    return {name: {"size": own.size, "fields": own.fields} for name, own in found.items()}


@dataclass
class Image:
    """Bytes of a system, and where they hold addresses.

    Attributes
    ----------
    bytes : bytearray
        The structure ``System`` of ``core/state.c``, then what it points to.
    places : list of int
        Offsets of its addresses.
    """

    bytes: bytearray = field(default_factory=bytearray)
    places: list[int] = field(default_factory=list)


def image_of(engine: TapeEngine) -> Image:
    """Write a system as an image."""
    system, blocks = engine.blocks()
    layout, image, known = layout_of(type(system)), Image(), dict[int, int]()

    def room(size: int) -> int:
        at = _up(len(image.bytes), 8)
        image.bytes.extend(bytes(at + size - len(image.bytes)))
        return at

    def placed(address: int) -> int:
        if address not in known:
            block = blocks[address]
            if isinstance(block, (ctypes.Structure, ctypes.Array)):
                several = [*block] if isinstance(block, ctypes.Array) else [block]
                inner = layout_of(type(several[0]))
                known[address] = room(inner.size * len(several))
                for k, one in enumerate(several):
                    write(one, inner, known[address] + k * inner.size)
            else:
                content = np.ascontiguousarray(block).tobytes()
                known[address] = room(len(content) + 8)  # an empty array has a place too
                image.bytes[known[address] : known[address] + len(content)] = content
        return known[address]

    def write(own: ctypes.Structure, layout: Layout, base: int) -> None:
        for name, (at, kind) in layout.fields.items():
            value = getattr(own, name)
            if isinstance(kind, Layout):
                write(value, kind, base + at)
            elif kind == "P":
                if value:
                    image.places.append(base + at)
                    struct.pack_into("<I", image.bytes, base + at, placed(value))
            else:
                struct.pack_into("<" + kind, image.bytes, base + at, value)

    write(system, layout, room(layout.size))
    return image


def _up(at: int, align: int) -> int:
    return -(-at // align) * align
