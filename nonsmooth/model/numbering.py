"""Numbers of operations and Taylor rules, and constants, that the model and the sources in C share.

A build of the package imports this module without CasADi.
"""

from __future__ import annotations

from .expressions.float_arithmetic import BINARY, UNARY

#: Operations by number, as in the C enumeration.
OPERATIONS = ("const", "input", *UNARY, *BINARY)

#: Rules by number, then those by which later coefficients follow: of sums with a kind of terms; of quotients of which one
#: argument does not move; of integrals over what is affine in the time, as in cos(omega t); of a sine with its cosine;
#: of what is chosen by a factor that does not move.
TAPE_RULES = tuple(
    "constant input apply sum div sqrt power integral quotient atan2 chosen "
    "linear1 linear2 linear3 linear4 linear over under turn pair turns gated".split()
)

#: Laws of elements, by number in C.
LAWS = ("surface", "contact", "set", "relay", "joint", "complementarity", "table")

#: Laws of impacts, by number in C.
IMPACT_LAWS = ("newton", "moreau", "poisson")

#: Most numbers in a condition of an event, and how a function in it is located that is not watched.
MOST_CODES, UNWATCHED = 256, 2

#: A step ends where |h| has fallen to this part: towards h = 0 a series may go on as -|h|.
FALL = 0.1

#: The same for friction's limit on the set, whose square is compared with that of what is needed.
LIMIT_FALL = 1e-3
