"""Which engine runs: the compiled one where it can, the reference driver where it must."""

from __future__ import annotations

import warnings
from functools import lru_cache

from ..model import OptionError, explain
from .compiled.build import ADVICE, CompilerError, find_compiler

ENGINES = ("auto", "reference", "compiled")


class CompilerWarning(UserWarning):
    """The compiled engine is not used because there is no working compiler."""


def use_compiled(engine: str, supported: bool = True) -> bool:
    """Whether to run the compiled engine.

    Parameters
    ----------
    engine : {"auto", "reference", "compiled"}
    supported : bool
        Whether the system has a compiled engine.

    Raises
    ------
    OptionError
        Another word, or ``"compiled"`` for a system that has none.
    CompilerError
        ``"compiled"`` without a compiler.
    """
    if engine not in ENGINES:
        raise OptionError(
            explain("engine", expected=f"one of {ENGINES}", received=repr(engine), advice="")
        )
    if engine == "reference":
        return False
    if not supported:
        if engine == "compiled":
            raise OptionError(
                "engine: expected 'auto' or 'reference' for a system with this many surfaces, "
                "received 'compiled'. It has too many modes to compile."
            )
        return False
    if find_compiler() is not None:
        return True
    if engine == "compiled":
        raise CompilerError(f"compiler: expected a C compiler, found none. {ADVICE}")
    warn_once(f"No C compiler was found: the slow reference driver is used. {ADVICE}")
    return False


@lru_cache(maxsize=16)
def warn_once(message: str) -> None:
    """Warn, once in a process for each message."""
    warnings.warn(message, CompilerWarning, stacklevel=4)
