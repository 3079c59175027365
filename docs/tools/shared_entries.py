"""An extension of griffe: of parameters that a docstring describes together, each shows its own type and text.

By itself griffe takes the annotation of the first for all of them, and `optional` for a type. "As in" another function
is replaced by what that function says of the parameter.
"""

from __future__ import annotations

import importlib
import inspect
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


_ENTRY = re.compile(r"^(\w+(?:, \w+)*)( : .*)?\n((?:[^\S\n]+.*\n?)+)", re.MULTILINE)
_AS_IN = re.compile(r"As (?:in|for) :func:`~?([\w.]+)`[.;,]?")


def one_each(doc: str, module: str = "nonsmooth", depth: int = 3) -> str:
    """Give each parameter of a list without a type an entry of its own, and each its text in place of "As in"."""

    def spell(found: re.Match[str]) -> str:
        name, kind, text = found.groups()
        reference = _AS_IN.search(text)
        other = _texts(reference[1], module, depth).get(name) if reference and depth else None
        if reference and other:
            rest = text[reference.end() :].strip()  # what holds here besides
            text = f"{other}    {rest[:1].upper()}{rest[1:]}\n" if rest else other
        return f"{name}{kind or ''}\n{text}"

    def section(found: re.Match[str]) -> str:
        return found[1] + _ENTRY.sub(spell, _TOGETHER.sub(_entries, found[2]))

    return _SECTION.sub(section, doc)


def _texts(path: str, module: str, depth: int) -> dict[str, str]:
    """What another function says of its parameters, by their names; nothing where there is no such function."""
    for start in (module, module.partition(".")[0], "nonsmooth"):
        thing: Any = importlib.import_module(start)
        for name in path.removeprefix("nonsmooth.").split("."):
            thing = getattr(thing, name, None)
        if inspect.isfunction(thing):
            doc = one_each(inspect.getdoc(thing) or "", thing.__module__, depth - 1)
            section = _SECTION.search(doc + "\n")
            listed = _ENTRY.findall(section[2]) if section else []
            return {name: text for names, _, text in listed for name in names.split(", ")}
    return {}


def _entries(found: re.Match[str]) -> str:
    """An entry for each name; what is said besides "As in" another function comes with the last."""
    text = found[2] if found[2].endswith("\n") else found[2] + "\n"
    reference = _AS_IN.search(text)
    short = f"    {reference[0]}\n" if reference else text
    *names, last = found[1].split(", ")
    return "".join(f"{name}\n{short}" for name in names) + f"{last}\n{text}"


class SharedEntries(griffe.Extension):
    """Rewrites docstrings of functions before they are parsed."""

    def on_function_instance(self, *, func: griffe.Function, **_: Any) -> None:
        """Called for every function that is read."""
        if func.docstring is not None:
            func.docstring.value = one_each(func.docstring.value, func.module.path)
