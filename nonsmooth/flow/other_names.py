"""Hints for arguments and attributes under the names that they have in scipy and other tools."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from ..model import OptionError

_P = ParamSpec("_P")
_R = TypeVar("_R")

_ARGUMENTS = {
    "t_span": "Give t_start= and t_end=, two numbers.",
    "y0": "The start is x0=.",
    "events": "Every switch, stop, reset and impact of the system is located: give it stops=[ns.Stop(...)] or resets=, "
    "or sample a run with at=.",
    "dense_output": "Every run is dense: call it with times, run(t).",
    "args": "Parameters are parameters={name: value}.",
    "p": "Parameters are parameters={name: value}.",
    "first_step": "Steps follow from tol=; max_step= limits them.",
    "h": "Steps follow from tol=; max_step= limits them.",
    "dt": "Steps follow from tol=; t_eval= gives times of samples.",
    "jac": "Derivatives are exact and need no jac=.",
    "vectorized": "ns.ensemble runs arrays of starts.",
}
#: Attributes of scipy's results, and what a run has for them.
ATTRIBUTES = {
    "y": "x, of shape (points, states)",
    "sol": "run(t): a run is called with times",
    "t_events": "events, each with t",
    "y_events": "events, each with x",
    "success": "status",
    "nfev": "steps",
}


def hinted(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Refuse arguments of other tools with a hint, and a time span in place of the end of a run."""

    @wraps(function)
    def run(*args: _P.args, **given: _P.kwargs) -> _R:
        for name in given.keys() & _ARGUMENTS.keys():
            raise OptionError(f"{function.__name__} has no argument {name}. {_ARGUMENTS[name]}")
        end = args[2] if len(args) > 2 else given.get("t_end")
        if isinstance(end, tuple | list):
            raise OptionError(
                f"t_end: expected a finite number, received {end!r}. The order is (system, x0, t_end); "
                "a span is t_start= and t_end=."
            )
        return function(*args, **given)

    return run
