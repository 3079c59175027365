"""Partial derivatives of each operation, written as instructions of a tape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, cast

from ..model.graph import Node

if TYPE_CHECKING:
    from .tape import Tape

#: Operations with a kink: allowed of parameters only.
KINKS = {"fabs", "fmin", "fmax"}

Partial = Callable[[], int]


def _chain(*steps: str) -> Callable[[Tape, int, Node], list[Partial]]:
    """Rules of functions of one variable as small programs: see ``_FORMULAS``."""

    def partials(t: Tape, w: int, node: Node) -> list[Partial]:
        return [lambda: _run(t, steps, {"w": w, "a": node.args[0]})]

    return partials


def _run(t: Tape, steps: Sequence[str], names: dict[str, int]) -> int:
    """Evaluate steps in reverse Polish notation: names, whole numbers, operations."""
    stack: list[int] = []
    for step in steps:
        if step in names:
            stack.append(names[step])
        elif step.lstrip("-").isdigit():
            stack.append(t.constant(float(step)))
        elif step == "pi":
            stack.append(t.node("pi"))
        else:
            count = 2 if step in ("add", "sub", "mul", "div") else 1
            args, stack = stack[-count:], stack[:-count]
            stack.append(t.apply(step, args))
    return stack[0]


_FORMULAS = {  # derivatives of w = f(a)
    "twice": "2",
    "neg": "-1",
    "sq": "a twice",
    "inv": "w sq neg",
    "sqrt": "1 w twice div",
    "exp": "w",
    "expm1": "w 1 add",
    "log": "a inv",
    "log1p": "1 a add inv",
    "sin": "a cos",
    "cos": "a sin neg",
    "tan": "1 w sq add",
    "asin": "1 a sq sub sqrt inv",
    "acos": "1 a sq sub sqrt inv neg",
    "atan": "1 a sq add inv",
    "sinh": "a cosh",
    "cosh": "a sinh",
    "tanh": "1 w sq sub",
    "asinh": "1 a sq add sqrt inv",
    "acosh": "a sq 1 sub sqrt inv",
    "atanh": "1 a sq sub inv",
    "erf": "2 pi sqrt div a sq neg exp mul",
    "erfinv": "pi sqrt 2 div w sq exp mul",
}

PARTIALS: dict[str, Callable[[Tape, int, Node], list[Partial]]] = {
    **{op: _chain(*text.split()) for op, text in _FORMULAS.items()},
    "add": lambda t, w, n: [lambda: t.constant(1)] * 2,
    "sub": lambda t, w, n: [lambda: t.constant(1), lambda: t.constant(-1)],
    "mul": lambda t, w, n: [lambda: n.args[1], lambda: n.args[0]],
    "div": lambda t, w, n: [
        lambda: t.apply("inv", [n.args[1]]),
        lambda: t.apply("neg", [t.apply("div", [w, n.args[1]])]),
    ],
    "power": lambda t, w, n: [
        lambda: t.apply(
            "mul",
            [t.constant(cast("int", n.payload)), t.power(n.args[0], cast("int", n.payload) - 1)],
        )
    ],
    "pow": lambda t, w, n: [
        lambda: t.apply("div", [t.apply("mul", [n.args[1], w]), n.args[0]]),
        lambda: t.apply("mul", [w, t.apply("log", [n.args[0]])]),
    ],
    "hypot": lambda t, w, n: [
        lambda: t.apply("div", [n.args[0], w]),
        lambda: t.apply("div", [n.args[1], w]),
    ],
    "atan2": lambda t, w, n: [
        lambda: t.apply("div", [n.args[1], _radius(t, n)]),
        lambda: t.apply("neg", [t.apply("div", [n.args[0], _radius(t, n)])]),
    ],
    **{op: lambda t, w, n: [] for op in ("pi", *KINKS)},
}


def _radius(t: Tape, n: Node) -> int:
    return t.add(t.apply("sq", [n.args[0]]), t.apply("sq", [n.args[1]]))
