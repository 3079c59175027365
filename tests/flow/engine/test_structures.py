"""Structures that Python reads from the C sources have the layout that a compiler gives them."""

import ctypes

from nonsmooth.flow.engine.building.build import build
from nonsmooth.flow.engine.structures import bodies, structure

FILLED = (
    "Options Batch Output System Rules Element Cells Series Values Entries Field Legs Leg".split()
)


def test_fields_are_where_the_compiler_puts_them():
    needed = {*FILLED, "Rule", "Term", "List"}
    text = "".join(
        f"typedef struct {{{body}}} {own};\n" for own, body in bodies().items() if own in needed
    )
    fields = [(own, field) for own in FILLED for field, _ in structure(own)._fields_]
    rows = [
        *(f"sizeof({own})" for own in FILLED),
        *(f"__builtin_offsetof({own}, {f})" for own, f in fields),
    ]
    source = f"#include <stdint.h>\n{text}const int64_t found[] = {{{', '.join(rows)}}};"
    found = (ctypes.c_int64 * len(rows)).in_dll(build(source), "found")[:]
    offsets = [getattr(structure(own), field).offset for own, field in fields]
    assert found == [ctypes.sizeof(structure(own)) for own in FILLED] + offsets
