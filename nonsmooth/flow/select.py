"""Which engine runs: the compiled one where it can, the reference driver where it must."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar
from weakref import WeakSet

from ..model import OptionError, explain
from .compiled.building.compilers import ADVICE, CompilerError, find_compiler
from .warn import CompilerWarning, warn_once

__all__ = ["ENGINES", "CompilerWarning", "compiled_or_none", "use_compiled"]

ENGINES = ("auto", "reference", "compiled")


T = TypeVar("T")

#: What could not be compiled; it is not tried again unless the compiled engine is asked for by name.
_GIVEN_UP: WeakSet[object] = WeakSet()

_SLOWLY = "The slow reference driver is used."


def use_compiled(engine: str, supported: bool = True) -> bool:
    """Whether to run the compiled engine."""
    if engine not in ENGINES:
        raise OptionError(
            explain("engine", expected=f"one of {ENGINES}", received=repr(engine), advice="")
        )
    if engine == "reference":
        return False
    if not supported:
        if engine == "compiled":
            raise OptionError(
                "engine: expected 'auto' or 'reference' for a system whose multipliers do not enter "
                "linearly, received 'compiled'. Only the reference driver serves it."
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
        raise CompilerError(f"compiler: expected a C compiler, found none. {ADVICE}")
    warn_once(f"No C compiler was found. {_SLOWLY} {ADVICE}")
    return False


def compiled_or_none(engine: str, of: object, work: Callable[[], T]) -> T | None:
    """Return what work with the compiled engine returns, or None where it cannot be compiled."""
    if engine == "compiled":
        return work()
    if of in _GIVEN_UP:
        return None
    try:
        return work()
    except CompilerError as error:
        _GIVEN_UP.add(of)
        told = f"{error.brief} {_SLOWLY} {ADVICE}" if error.brief else f"{error} {_SLOWLY}"
        warn_once(told)
        return None
