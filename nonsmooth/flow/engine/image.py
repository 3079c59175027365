"""A system as one block of bytes with 32-bit addresses, which a page passes to the driver.

WebAssembly has addresses of 4 bytes. They count from the first byte of the image; the code that copies it into the
module's memory adds its address.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .interpreter import Interpreter
from .structures import structure

#: An address there.
_ADDRESS = ctypes.c_uint32


def exchanged() -> dict[str, dict[str, Any]]:
    """Sizes of the structures that a page writes for the driver, with offset and kind of each field, for JSON."""
    found = dict[str, dict[str, Any]]()
    for name in ("Options", "Batch", "Output"):
        own: Any = structure(name, _ADDRESS)
        kinds = {field: "P" if kind is _ADDRESS else kind._type_ for field, kind in own._fields_}
        fields = {field: (getattr(own, field).offset, kind) for field, kind in kinds.items()}
        found[name] = {"size": ctypes.sizeof(own), "fields": fields}
    return found


@dataclass
class Image:
    """Bytes of a system, and where they hold addresses.

    Attributes
    ----------
    bytes : bytearray
        The structure ``System`` of ``core/state.c``, then what it points to.
    addresses : list of int
        Offsets of its addresses.
    """

    bytes: bytearray = field(default_factory=bytearray)
    addresses: list[int] = field(default_factory=list)


def image_of(engine: Interpreter) -> Image:
    """Write a system as an image."""
    system, blocks = engine.blocks()
    image, known = Image(), dict[int, int]()

    def room(size: int) -> int:
        at = -(-len(image.bytes) // 8) * 8
        image.bytes.extend(bytes(at + size - len(image.bytes)))
        return at

    def put(content: bytes, at: int) -> None:
        image.bytes[at : at + len(content)] = content

    def placed(address: int) -> int:
        if address not in known:
            block = blocks[address]
            if isinstance(block, (ctypes.Structure, ctypes.Array)):
                several = [*block] if isinstance(block, ctypes.Array) else [block]
                size = ctypes.sizeof(structure(type(several[0]).__name__, _ADDRESS))
                known[address] = room(size * len(several))
                for k, one in enumerate(several):
                    put(bytes(narrow(one, known[address] + k * size)), known[address] + k * size)
            else:
                content = np.ascontiguousarray(block).tobytes()
                known[address] = room(len(content) + 8)  # an empty array has an address too
                put(content, known[address])
        return known[address]

    def narrow(own: ctypes.Structure, base: int) -> ctypes.Structure:
        made: Any = structure(type(own).__name__, _ADDRESS)()
        for name, kind, *_ in own._fields_:
            value, at = getattr(own, name), base + getattr(type(made), name).offset
            if isinstance(value, ctypes.Structure):
                value = narrow(value, at)
            elif kind is ctypes.c_void_p and value:
                image.addresses.append(at)
                value = placed(value)
            setattr(made, name, value or 0)
        return made

    room(ctypes.sizeof(structure(type(system).__name__, _ADDRESS)))
    put(bytes(narrow(system, 0)), 0)
    return image
