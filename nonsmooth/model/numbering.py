"""Numbers of operations and Taylor rules, and constants, that the model and the sources in C share.

A build of the package imports this module without CasADi.
"""

from __future__ import annotations

from collections.abc import Sequence

from .expressions.float_arithmetic import BINARY, UNARY

#: Operations by number, as in the C enumeration.
OPERATIONS = ("const", "input", *UNARY, *BINARY)

#: C of operations: arithmetic; functions of the C library; what only numbers go through.
ARITHMETIC = {
    "assign": "{0}",
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
    "neg": "-{0}",
    "sq": "{0} * {0}",
    "twice": "2.0 * {0}",
    "inv": "1.0 / {0}",
}
LIBRARY = {
    name: name
    for name in "sqrt exp log sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh "
    "atan2 pow erf hypot expm1 log1p".split()
} | {"constpow": "pow", "erfinv": "ns_erfinv"}
_CHOICES = {
    "sign": "({0} == {0} ? ns_sign({0}) : NAN)",
    "lt": "(double)({0} < {1})",
    "le": "(double)({0} <= {1})",
    "eq": "(double)({0} == {1})",
    "ne": "(double)({0} != {1})",
    "not": "(double)(!{0})",
    "and": "(double)({0} && {1})",
    "or": "(double)({0} || {1})",
    "if_else_zero": "({0} ? {1} : 0.0)",
}


def operation_in_c(op: str, args: Sequence[str]) -> str:
    """Return C of an operation on numbers."""
    if (text := ARITHMETIC.get(op) or _CHOICES.get(op)) is not None:
        return text.format(*args)
    return f"{LIBRARY.get(op, op)}({', '.join(args)})"


#: Rules by number, then those by which later coefficients follow: of sums with a kind of terms; of quotients of which one
#: argument does not move; of integrals over what is affine in the time, as in cos(omega t); of a sine with its cosine;
#: of what is chosen by a factor that does not move.
TAYLOR_RULES = tuple(
    "constant input apply sum div sqrt power integral quotient atan2 chosen "
    "linear1 linear2 linear3 linear4 linear over under turn pair turns gated".split()
)

#: Laws of elements, by number in C.
LAWS = ("surface", "contact", "set", "relay", "joint", "complementarity", "table")

#: Laws of impacts, by number in C.
IMPACT_LAWS = ("newton", "moreau", "poisson")

#: Most numbers in a condition of an event, and the direction of a function in it that is not located.
MOST_CODES, UNWATCHED = 256, 2

#: A step ends where |h| has fallen to this part: towards h = 0 a series may continue as -|h|.
FALL = 0.1

#: The same for friction's limit on the set, whose square is compared with that of the required friction.
LIMIT_FALL = 1e-3
