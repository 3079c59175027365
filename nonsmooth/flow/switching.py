"""Filippov's logic at a point of one or several surfaces: which motions can continue from here.

A mode can continue if each of its guards that vanishes here becomes positive at once: its first
nonzero Taylor coefficient is positive. For a side that is "the field leaves to this side", for
sliding it is "both fields point at the surface". One such mode: the motion continues in it. More
than one: the future is not unique. The coefficients that are zero by construction are dropped, so
there is no push off the surface by an epsilon.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..model import Array, Intersection, motion
from . import messages
from .status import Status
from .stepper import Expansion, Stepper

#: Number of leading coefficients of a guard that vanish by construction, by (kind, surface, side).
Known = Mapping[tuple[str, int, int], int]


@dataclass(frozen=True)
class Continuation:
    """A mode that can continue, and the coefficients to drop from its guards in the first step.

    ``multipliers`` are those of an :class:`Intersection`, which has them as further states.
    """

    mode: str
    drops: dict[int, int]
    strict: bool
    multipliers: Array


@dataclass(frozen=True)
class Decision:
    """Either one continuation or the reason why there is none."""

    continuation: Continuation | None
    status: Status = Status.REACHED_END
    message: str = ""


def decide(
    stepper: Stepper,
    x: Array,
    mode: str,
    active: Sequence[int],
    known: Known,
    layer: tuple[float, int] | None = None,
) -> Decision:
    """Choose the motion that continues from a point of the surfaces ``active``.

    Parameters
    ----------
    stepper : Stepper
    x : ndarray (N,)
        Extended state, on the active surfaces.
    mode : str
        Letters of the surfaces that are not active; the others are ignored.
    active : sequence of int
        Surfaces through the point.
    known : mapping
        Coefficients known to vanish, besides the values of h at the active surfaces.
    layer : (float, {-1, 1}), optional
        With hidden dynamics and one active surface: where its multiplier comes from and which way
        it moves through the layer lambda in [-1, 1].
    """
    singular = _two_folds(stepper, x, mode, active)
    if singular:
        return Decision(None, Status.NON_UNIQUE, messages.two_fold(singular[0]))
    found = [
        c for m in _candidates(mode, active) for c in _continuations(stepper, x, m, active, known)
    ]
    strict = [c for c in found if c.strict]
    if layer is not None and stepper.system.hidden and len(active) == 1:
        strict = _through_layer(strict, active[0], *layer)
    if len(strict) == 1 or (not strict and len(found) == 1):
        return Decision((strict or found)[0])
    if len(strict) > 1:
        return Decision(None, Status.NON_UNIQUE, messages.ambiguous([c.mode for c in strict]))
    resting = [c for c in found if "s" in c.mode]
    if resting:
        return Decision(resting[0])
    if len(active) > 1:
        return Decision(None, Status.INTERSECTION, messages.no_stable_motion(active))
    return Decision(None, Status.NON_UNIQUE, messages.degenerate())


def _candidates(mode: str, active: Sequence[int]) -> Iterable[str]:
    for letters in product("+-s", repeat=len(active)):
        candidate = list(mode)
        for i, letter in zip(active, letters, strict=True):
            candidate[i] = letter
        yield "".join(candidate)


def _continuations(
    stepper: Stepper, x: Array, mode: str, active: Sequence[int], known: Known
) -> Iterable[Continuation]:
    of_mode = motion(stepper.system, mode)
    points = of_mode.solutions(x, stepper.p) if isinstance(of_mode, Intersection) else [x]
    for point in points:
        continuation = _continuation(stepper, point, mode, active, known)
        if continuation is not None:
            yield continuation


def _continuation(
    stepper: Stepper, x: Array, mode: str, active: Sequence[int], known: Known
) -> Continuation | None:
    e = stepper.expand(mode, x)
    if not e.finite:
        e = _finite_prefix(e)
    drops, strict = {}, True
    for row, guard in enumerate(stepper.guards(mode)):
        if guard.kind in ("stop", "reset") or guard.index not in active:
            continue
        zeros = known.get((guard.kind, guard.index, guard.side), 0)
        zeros = max(zeros, 1 if guard.kind == "surface" else 0)
        k, value = stepper.leading(e, row, zeros)
        if value < 0.0:
            return None
        if value == 0.0:
            strict = False
        drops[row] = min(k, e.guards.shape[1] - 1) if value else e.guards.shape[1]
    return Continuation(mode, drops, strict, x[stepper.system.extended_dimension :])


def _through_layer(
    found: Sequence[Continuation], surface: int, origin: float, direction: int
) -> list[Continuation]:
    """First equilibrium of the layer problem that lambda meets on its way, if any (Jeffrey 2018)."""

    def ahead(c: Continuation) -> float:
        letter = c.mode[surface]
        lam = float(c.multipliers[0]) if letter == "s" else (1.0 if letter == "+" else -1.0)
        return (lam - origin) * direction

    return sorted((c for c in found if ahead(c) > 1e-5), key=ahead)[:1]


def _finite_prefix(e: Expansion) -> Expansion:
    """Zero the coefficients that are not finite: they decide nothing."""
    states, guards = e.states.copy(), e.guards.copy()
    for c in (states, guards):
        c[~np.isfinite(c)] = 0.0
    return Expansion(e.mode, states, guards, e.scales, e.gradient, False)


def _two_folds(stepper: Stepper, x: Array, mode: str, active: Sequence[int]) -> list[int]:
    """Active surfaces both of whose fields are tangent here and whose sliding field is 0/0."""
    if len(active) != 1:
        return []
    i = active[0]
    sliding = mode[:i] + "s" + mode[i + 1 :]
    if motion(stepper.system, sliding).cancelled:
        return []
    return [i] if is_two_fold(stepper, stepper.expand(sliding, x), i) else []


def is_two_fold(stepper: Stepper, e: Expansion, surface: int, tolerance: float = 0.0) -> bool:
    """Whether both fields are tangent to a surface at a point of sliding mode ``e.mode``.

    ``tolerance`` is on the angles between fields and surface; rounding is always allowed.
    """
    rows = [
        row
        for row, guard in enumerate(stepper.guards(e.mode))
        if guard.kind == "exit" and guard.index == surface
    ]
    return all(
        abs(e.guards[row, 0]) <= (tolerance + 2e-14) * e.scales[row] and e.scales[row] > 0
        for row in rows
    )
