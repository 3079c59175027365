"""Choice of the engine: the compiled one, or the reference driver where nothing compiles."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar
from weakref import WeakSet

from ..model import OptionError
from .compiled.building.compilers import ADVICE, CompilerError, find_compiler
from .warn import warn_once

ENGINES = ("auto", "reference", "compiled")

T = TypeVar("T")

#: Programs that could not be compiled; they are tried again only with engine="compiled".
_GIVEN_UP: WeakSet[object] = WeakSet()

_SLOWLY = "The slow reference driver is used."


def use_compiled(engine: str, supported: bool = True) -> bool:
    """Whether to run the compiled engine."""
    if engine not in ENGINES:
        raise OptionError(f"engine is {engine!r}. Give one of {ENGINES}.")
    if engine == "reference":
        return False
    if not supported:
        if engine == "compiled":
            raise OptionError(
                "engine is 'compiled', but the multipliers of the system do not enter linearly. Give "
                "'auto' or 'reference': only the reference driver runs such a system."
            )
        return False
    try:
        if find_compiler() is not None:
            return True
    except CompilerError as error:
        if engine == "compiled":
            raise
        warn_once(f"{error} {_SLOWLY}")
        return False
    if engine == "compiled":
        raise CompilerError(f"No C compiler was found. {ADVICE}")
    warn_once(f"No C compiler was found. {_SLOWLY} {ADVICE}")
    return False


def compiled_or_none(engine: str, of: object, work: Callable[[], T]) -> T | None:
    """Return the result of ``work``, or None where its program cannot be compiled."""
    if engine == "compiled":
        return work()
    if of in _GIVEN_UP:
        return None
    try:
        return work()
    except CompilerError as error:
        _GIVEN_UP.add(of)
        message = f"{error.brief} {_SLOWLY} {ADVICE}" if error.brief else f"{error} {_SLOWLY}"
        warn_once(message)
        return None
