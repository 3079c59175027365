"""Itineraries beside a corner, where two events happen at one time.

The events change their order, or the orbit passes the corner on the other side of a second surface: it
crosses that shortly before the first one, and back after it.
"""

from __future__ import annotations

from itertools import pairwise

from ..model import Array, Guard
from ..model.variational import guarded_field
from .chains import Chain, Edited, mode_after, rotated, with_letter
from .conditions import Condition, surface_of
from .itinerary import leg_between
from .legs import fly
from .mirrors import TURNED

#: Legs that are shorter than this part of the orbit vanish.
_SHORT = 1e-7


def swapped(chain: Chain, i: int) -> Edited | None:
    """Two events at one time in the other order."""
    system, (first, second) = chain.problem.system, chain.legs[i - 1 : i + 1]
    a, b = surface_of(system, first), surface_of(system, second)
    if a < 0 or b < 0 or a == b:
        return None
    between = with_letter(first.mode, b, mode_after(second)[b])
    chain.legs[i - 1] = leg_between(system, first.mode, between)
    chain.legs[i] = leg_between(system, between, with_letter(between, a, second.mode[a]))
    return chain.done(i)


def round_corner(chain: Chain, i: int, guard: Guard, p: Array) -> Edited | None:
    """A second surface is crossed before the crossing that leads to leg ``i``, and back after it."""
    system, k = chain.problem.system, (i - 1) % len(chain.legs)
    before, far = chain.legs[k], guard.index
    if guard.kind != "surface" or before.kind != "crossing":
        return None
    flown = fly(system, before, chain.starts[k], chain.durations[k], p)
    start = before.at_end(system, flown.end, p).after
    turned = before.mode[far].translate(TURNED)
    modes = [before.mode, with_letter(before.mode, far, turned)]
    modes += [with_letter(mode_after(before), far, turned), mode_after(before)]
    legs = [leg_between(system, a, b) for a, b in pairwise(modes)]
    chain.legs[k] = legs[0]
    chain.insert(k + 1, legs[1], start)
    chain.insert(k + 2, legs[2], start)
    return chain.done(k + 1, k + 2)


def cut_corner(before: Edited, i: int, p: Array) -> Edited | None:
    """Two short legs beyond a second surface, left out; None where there are no such two."""
    system, count = before.problem.system, len(before.problem.legs)
    durations = before.problem.split(before.u)[1]
    short = [
        j for j in ((i + 1) % count, (i - 1) % count) if durations[j] < _SHORT * sum(durations)
    ]
    if count < 4 or not short:
        return None
    turned = rotated(before, ((i if short[0] == (i + 1) % count else short[0]) - 1) % count, p)
    chain = Chain(turned.problem, turned.u, turned.origin)
    first, between, last = chain.legs[:3]
    far, own = surface_of(system, first), surface_of(system, between)
    crossed = all(leg.kind == "crossing" for leg in (first, between, last))
    if not crossed or surface_of(system, last) != far or own == far:
        return None
    chain.legs[0] = leg_between(system, first.mode, mode_after(last))
    chain.remove(2)
    chain.remove(1)
    guards = guarded_field(system, mode_after(last)).motion.guards
    guard = next(g for g in guards if g.kind == "surface" and g.index == far)
    return chain.done(test=Condition("start", 1, guard))
