"""An extension of griffe: of parameters that a docstring describes together, each shows its own type.

By itself griffe takes the annotation of the first for all of them, and `optional` for a type.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

_SECTION = re.compile(
    r"^((?:Other )?Parameters\n-+\n)((?:.*\n?)+?)(?=^[A-Z][\w ]*\n-+$|\Z)", re.MULTILINE
)
_TOGETHER = re.compile(
    r"^(\w+(?:, \w+)+(?= : optional\n|\n)|\w+(?= : optional\n))(?: : optional)?\n((?:[^\S\n]+.*\n?)+)",
    re.MULTILINE,
)


def one_each(doc: str) -> str:
    """Give each parameter of a list without a type an entry of its own."""
    return _SECTION.sub(lambda found: found[1] + _TOGETHER.sub(_entries, found[2]), doc)


def _entries(found: re.Match[str]) -> str:
    text = found[2] if found[2].endswith("\n") else found[2] + "\n"
    return "".join(f"{name}\n{text}" for name in found[1].split(", "))


class SharedEntries(griffe.Extension):
    """Rewrites docstrings of functions before they are parsed."""

    def on_function_instance(self, *, func: griffe.Function, **_: Any) -> None:
        """Called for every function that is read."""
        if func.docstring is not None:
            func.docstring.value = one_each(func.docstring.value)
