"""Structures and functions of the C sources as ctypes has them, read from the sources themselves."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator, Mapping
from functools import cache

from .building.core_source import driver_text

#: Sources with structures that Python fills, and with functions of the driver that it calls.
_STRUCTURES = "common.h programs.h state.c legs/flow.c legs/fixed.c legs/variation.c".split()
_CALLED = "state.c entry.c legs/fixed.c legs/legs.c".split()

_NUMBERS = {
    "double": ctypes.c_double,
    "int": ctypes.c_int,
    "int8_t": ctypes.c_int8,
    "int32_t": ctypes.c_int32,
    "int64_t": ctypes.c_int64,
}


def _plain(name: str) -> str:
    return re.sub(r"/\*.*?\*/", "", driver_text(name), flags=re.DOTALL)


@cache
def bodies() -> Mapping[str, str]:
    """Return the declarations in each structure, in the order of the sources."""
    text = "".join(_plain(f"core/{name}") for name in _STRUCTURES)
    return {name: body for body, name in re.findall(r"typedef struct \{([^}]*)\} (\w+);", text)}


def structure(name: str, address: type = ctypes.c_void_p) -> type[ctypes.Structure]:
    """Return a structure of C with a type of addresses."""
    return _structure(name, address)


@cache
def _structure(name: str, address: type) -> type[ctypes.Structure]:
    lines = [line.strip() for line in bodies()[name].split(";")]
    fields = [field for line in lines for field in _fields(line, address)]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _fields(declaration: str, address: type) -> Iterator[tuple[str, type]]:
    """Names and types of the fields of one declaration."""
    if function := re.search(r"\(\*(\w+)\)\(", declaration):
        yield function[1], address
    elif declaration:
        kind, names = re.sub(r"\bconst\b", "", declaration).strip().split(None, 1)
        for name in names.split(","):
            is_pointer = "*" in name
            own = address if is_pointer else _NUMBERS.get(kind) or structure(kind, address)
            yield name.replace("*", "").strip(), own


def declare(library: ctypes.CDLL, *sources: str) -> ctypes.CDLL:
    """Give the functions that some sources, or those of the driver, define their types in a library."""
    head = rf"^(?:({'|'.join(_NUMBERS)})|void|\w+ (\*)) ?(\w+)\(([^)]*)\) {{"
    for source in sources or [f"core/{name}" for name in _CALLED]:
        for kind, star, name, given in re.findall(head, _plain(source), re.MULTILINE):
            function = getattr(library, name)
            function.restype = ctypes.c_void_p if star else _NUMBERS.get(kind)
            arguments = [] if given == "void" else given.split(",")
            function.argtypes = [_argument(own) for own in arguments]
    return library


def _argument(given: str) -> type:
    kind = given.replace("const", "").split()[0]
    return ctypes.c_void_p if "*" in given or "(" in given else _NUMBERS[kind]
