"""Following curves: N - 1 smooth equations in N unknowns, by pseudo-arclength continuation.

It follows equilibria and periodic orbits as a parameter varies, curves of bifurcations in two
parameters, curves of two-folds and dividing curves. A curve is a subclass of :class:`Curve` that
gives its equations with their Jacobian and its test functions;
:func:`trace` follows it: predictor, Newton corrections across the tangent, step control, turning
points, located zeros of tests, ends that are solved for, bounds. Curves whose equations change from
piece to piece are traced by :func:`pieces`. An interrupt (Ctrl-C) returns what was computed.

Sources: Keller 1977 (pseudo-arclength); Allgower & Georg 1990; Kuznetsov 2004, ch. 10.
"""

from ...result_tables import add_views
from ..newton import Secant, Values, converge
from .arc import Arc, ahead, trace
from .curve import Curve, Point, Zero
from .pieces import Departure, changes_around, depart, directions, other_direction, pieces

__all__ = [
    "Arc",
    "Curve",
    "Departure",
    "Point",
    "Secant",
    "Values",
    "Zero",
    "ahead",
    "changes_around",
    "converge",
    "depart",
    "directions",
    "other_direction",
    "pieces",
    "trace",
]

add_views(globals(), __all__)
