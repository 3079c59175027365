"""Itinerary beyond a discontinuity-induced bifurcation, and initial unknowns for the orbit there.

| bifurcation | fewer legs | more legs |
|---|---|---|
| grazing-sliding | a | a s a |
| crossing-sliding | a b | a s b |
| switching-sliding | a s | a b s |
| adding-sliding | s | s b s |
| impact grazing | a | a impact a |
| grazing of a soft switch | a | a b a |
| corner | two events at one time, in the other order | |
| corner that adds legs | a b | a c d b, past a second surface and back |

A new leg begins with the duration 0, which the smooth flow of its mode accepts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ...flow.fixed import first_terms
from ...model import Array, Guard, NonsmoothError
from ...model.derivatives.variational import guarded_field, states_at
from ...solvers.continuation import Departure
from ..periodic.boundary_value_problem import (
    TURNED,
    BoundaryProblem,
    Evaluation,
    mirrored,
    neighbours,
)
from ..periodic.find_periodic import at_two_fold
from ..runs.itinerary import leg_between
from ..runs.legs import Leg, integrate_leg, surface_of
from .conditions import Condition, touching

# Insertion and removal of legs.


@dataclass(frozen=True, eq=False)
class ChangedItinerary:
    """An itinerary beyond a bifurcation."""

    problem: BoundaryProblem
    u: Array
    origin: tuple[int, ...]
    test: str = ""

    @property
    def fresh(self) -> tuple[int, ...]:
        """The legs that grow from zero; several in an orbit that is symmetric."""
        return tuple(i for i, before in enumerate(self.origin) if before == -2)


class LegEditor:
    """Legs of a problem, with insertion and removal."""

    def __init__(self, problem: BoundaryProblem, u: Array, origin: Sequence[int]):
        self.problem, self.legs, self.origin = problem, list(problem.legs), list(origin)
        starts, durations = problem.split(u)
        self.starts, self.durations = [np.array(x) for x in starts], durations.tolist()

    def insert(self, k: int, leg: Leg, start: Array) -> None:
        """A new leg of no duration."""
        self.legs.insert(k, leg)
        self.starts.insert(k, start)
        self.durations.insert(k, 0.0)
        self.origin.insert(k, -1)

    def remove(self, k: int) -> None:
        for rows in (self.legs, self.starts, self.durations, self.origin):
            del rows[k]

    def done(self, *fresh: int, test: Condition | None = None) -> ChangedItinerary:
        whole = replace(self.problem, legs=tuple(self.legs))
        u = whole.pack(np.array(self.starts), np.array(self.durations))
        for k in fresh:
            self.origin[k] = -2
        return ChangedItinerary(whole, u, tuple(self.origin), "" if test is None else test.name)


def mode_after(leg: Leg) -> str:
    """The mode that follows the event of a leg, if its letters determine it; else empty."""
    if leg.kind in ("contact", "release"):
        return with_letter(leg.mode, leg.element, _OTHER[leg.mode[leg.element]])
    if leg.kind not in ("crossing", "entry", "exit"):
        return ""
    turned = leg.mode[leg.element].translate(TURNED)
    letter = {"crossing": turned, "entry": "s"}.get(leg.kind, "+" if leg.side > 0 else "-")
    return with_letter(leg.mode, leg.element, letter)


#: The letter of an element beyond a touch of its function, or of its multiplier while it is closed.
_OTHER = {"+": "-", "-": "+", "o": "c", "c": "o"}


def with_letter(mode: str, surface: int, letter: str) -> str:
    return mode[:surface] + letter + mode[surface + 1 :]


def rotated(before: ChangedItinerary, k: int, p: Array) -> ChangedItinerary:
    """The same orbit from leg ``k``; legs moved to the end belong to the next period."""
    problem, (starts, durations) = before.problem, before.problem.split(before.u)
    legs = (*problem.legs[k:], *(mirrored(problem, leg) for leg in problem.legs[:k]))
    shift = np.zeros(problem.dimension)
    if problem.forcing is not None:
        shift[-1] = problem.advance(p)[0]
    back = np.linalg.inv(problem.wrap)
    moved = [*starts[k:], *(back @ (x + shift) for x in starts[:k])]
    whole = replace(problem, legs=legs)
    u = whole.pack(np.array(moved), np.concatenate([durations[k:], durations[:k]]))
    return ChangedItinerary(whole, u, (*before.origin[k:], *before.origin[:k]))


#: Jump of the state at an event that is touched, relative to its size, below which there is none.
_NEIGHBOURS = 1e-5

#: Sine of the angle at which a field is tangent to a surface.
_TANGENT = 1e-7

#: L of the other field, relative to its gradient and the state, where a slide touches both folds, and where it ends
#: beside both, as at a two-fold the equations are singular.
_BOTH, _BESIDE = 1e-9, 1e-7

SOFT, FORCE = "grazing of a soft switch", "grazing of a jumping force"
CHATTER_END, PLASTIC = "end of complete chatter", "plastic impact"

#: Grazing of a soft switch by the orbits of a centre, at whose value of the parameter all of these exist.
CENTRE = "focus-centre-limit cycle"


def kind_of(problem: BoundaryProblem, test: Condition, at: Evaluation, p: Array) -> str:
    """The kind of bifurcation at the zero of a test."""
    legs, i = problem.legs, test.leg
    leg, guard = legs[i], test.guard
    before, after = neighbours(problem, i)
    if before.repeats and (
        test.what == "duration" or (guard is not None and guard.kind == "release")
    ):
        return CHATTER_END
    if leg.repeats and test.what == "duration":
        return "impact grazing"  # the first impact
    if test.what == "interior":
        assert guard is not None
        return _grazed(problem, leg, guard, test, at, p)
    if test.what == "start":
        assert guard is not None
        if before.kind == "crossing" and surface_of(problem.system, before) == guard.element:
            return "crossing-sliding"
        return "switching-sliding" if guard.kind == "exit" and before.kind == "entry" else "corner"
    if test.what == "end":
        return "two-fold"
    if test.what == "transversality":
        if at_two_fold(problem.system, leg, at.flows.end[i], p, at.starts, _BESIDE):
            return "two-fold"
        return {
            "impact": "impact grazing",
            "reset": "grazing of a reset",
            "exit": "adding-sliding",
            "release": "adding-sliding",
        }.get(leg.kind, "grazing, escaping")
    if {before.kind, leg.kind} == {"contact", "release"} and before.element == leg.element:
        name = _touch(
            problem, leg.element, "adding-sliding" if leg.kind == "contact" else "grazing-sliding"
        )
        return name if before.mode == mode_after(leg) else "corner"
    if before.kind == "entry" and leg.kind == "exit":
        came, left = before.mode, mode_after(leg)
        return "grazing-sliding" if came == left else "crossing-sliding"
    if before.kind == leg.kind == "crossing" and before.mode == after.mode:
        if surface_of(problem.system, before) == surface_of(problem.system, leg):
            return soft_switch(problem, leg, surface_of(problem.system, leg)) or "corner"
    if leg.kind == "entry" and before.kind == "exit":
        return "adding-sliding" if after.mode == before.mode or len(legs) == 2 else "corner"
    if leg.kind == "entry" and before.kind == "crossing":
        same = surface_of(problem.system, leg) == surface_of(problem.system, before)
        return "switching-sliding" if same else "corner"
    return "corner"


def _grazed(
    problem: BoundaryProblem, leg: Leg, guard: Guard, test: Condition, at: Evaluation, p: Array
) -> str:
    if guard.kind == "impact":
        return "impact grazing"
    if guard.kind in ("reset", "stop", "atom"):
        return f"grazing of a {'stop' if guard.kind == 'stop' else 'reset'}"
    if guard.kind == "exit":
        t = touching(
            problem.system, leg, test, at.starts[test.leg], float(at.durations[test.leg]), p
        )[0]
        y = integrate_leg(problem.system, leg, at.starts[test.leg], t, p).end
        ends = replace(leg, kind="exit", element=guard.element, side=guard.side)
        return (
            "two-fold"
            if at_two_fold(problem.system, ends, y, p, at.starts, _BOTH)
            else "adding-sliding"
        )
    if is_condition(problem, guard):
        return _touch(
            problem,
            guard.element,
            "grazing-sliding" if guard.kind == "surface" else "adding-sliding",
        )
    if guard.kind == "release":
        return "release"
    x, duration = at.starts[test.leg], float(at.durations[test.leg])
    t = touching(problem.system, leg, test, x, duration, p)[0]
    y = integrate_leg(problem.system, leg, x, t, p).end[: problem.dimension]
    other = (
        leg.mode[: guard.element] + ("-" if guard.side > 0 else "+") + leg.mode[guard.element + 1 :]
    )
    field = leg_between(problem.system, leg.mode, other).map(problem.system)
    assert field is not None
    soft = soft_switch(problem, leg, guard.element)
    if soft == SOFT:
        return soft
    gradient = field(y, p).gradient[: problem.dimension]
    rate = Leg(other).field(problem.system).rate.copied(y, p)[0][: problem.dimension, 0]
    across = float(gradient @ rate)
    if abs(across) <= _TANGENT * float(np.linalg.norm(gradient) * np.linalg.norm(rate)):
        if soft == FORCE and _leads_away(problem, other, guard.element, y, p):
            return "grazing, escaping"
        return soft or "two-fold"  # both fields touch there
    return "grazing-sliding" if across > 0.0 else "grazing, escaping"


def _touch(problem: BoundaryProblem, element: int, of_degree_one: str) -> str:
    """The kind of a touch of a complementarity condition; for degree 0 the field is continuous there."""
    system = problem.system
    return SOFT if system.entries[element][0] in system.algebraic else of_degree_one


def _leads_away(problem: BoundaryProblem, mode: str, surface: int, y: Array, p: Array) -> bool:
    """Whether the field beyond a surface, tangent to it too, bends away from it."""
    field = guarded_field(problem.system, mode)
    own = [g.kind == "surface" and g.element == surface for g in field.motion.guards].index(True)
    states = states_at(problem.system, mode, y, p)
    return float(first_terms(field, states, p)[1][own, 2]) > 0.0


def soft_switch(problem: BoundaryProblem, leg: Leg, surface: int) -> str:
    """The grazing of a surface on which nothing slides; empty where something may."""
    known = {i for i, letter in enumerate(leg.mode) if letter in "+-s"}
    mode = leg.mode[: len(problem.system.entries)] if len(known) == len(leg.mode) else None
    found = problem.system.switching(surface, mode=mode)
    if found.slides:
        return ""
    return FORCE if found.force_jumps else SOFT


def changed_itinerary(
    problem: BoundaryProblem, kind: str, conditions: Sequence[Condition], u: Array, p: Array
) -> ChangedItinerary | None:
    """The itinerary beyond a bifurcation; None where nothing continues it."""
    every = tuple(range(len(problem.legs)))
    found: ChangedItinerary | None = ChangedItinerary(problem.whole, problem.undivided(u), every)
    for condition in conditions:
        assert found is not None
        if condition.leg not in found.origin:
            continue
        at = replace(condition, leg=found.origin.index(condition.leg))
        longer = condition.what in ("interior", "start")
        found = (_longer if longer else _shorter)(found, kind, at, p)
        if found is None:
            return None
    return found


# added legs ---------------------------------------------------------------------------------------


def _longer(
    before: ChangedItinerary, kind: str, at: Condition, p: Array
) -> ChangedItinerary | None:
    editor, i = LegEditor(before.problem, before.u, before.origin), at.leg
    if kind in ("crossing-sliding", "switching-sliding"):
        return _inserted(editor, kind, i, p)
    if kind == "corner" and at.what == "start" and at.guard is not None:
        if is_condition(before.problem, at.guard) and at.guard.kind == "surface":
            return closed_before(editor, i, at.guard, p)
        if at.guard.kind == "reset":
            return _again(editor, i, p)
        return round_corner(editor, i, at.guard, p)
    if at.guard is None or at.what != "interior" or kind == "grazing, escaping":
        return None
    problem = before.problem
    leg, x, duration = editor.legs[i], editor.starts[i], editor.durations[i]
    t = touching(problem.system, leg, at, x, duration, p)[0]
    y = integrate_leg(problem.system, leg, x, t, p).end[: problem.dimension]
    added = _added(problem, leg, at.guard, kind, y, p)
    if added is None:
        return None
    between, states = added
    if leg.timed and problem.phase is not None:  # a smooth orbit: it now begins where it touches
        legs = tuple(between)
        whole = replace(problem, legs=legs, phase=None, reference=None)
        times = [duration, *[0.0] * (len(legs) - 1)]
        shift = np.zeros(problem.dimension)
        shift[-1] = problem.advance(p)[0] if problem.forcing is not None else 0.0
        begin = np.linalg.inv(problem.wrap) @ (states[-1] - shift)
        v = whole.pack(np.array([begin, *states[: len(legs) - 1]]), np.array(times))
        return ChangedItinerary(whole, v, (*[0, *[-1] * len(legs)][: len(legs) - 1], -2))
    for k, (new, start) in enumerate(zip([*between[1:], leg], states, strict=True)):
        editor.insert(i + 1 + k, new, start)
    editor.legs[i], editor.durations[i] = between[0], t
    editor.durations[i + len(states)] = duration - t
    return editor.done(*([i + 1] if len(states) > 1 else []))


def _inserted(editor: LegEditor, kind: str, i: int, p: Array) -> ChangedItinerary:
    """A short leg between a crossing or entry and leg ``i``."""
    system, k = editor.problem.system, (i - 1) % len(editor.legs)
    before = editor.legs[k]
    surface = surface_of(system, before)
    flow = integrate_leg(system, before, editor.starts[k], editor.durations[k], p)
    start = before.at_event(system, flow.end, p).after
    if kind == "crossing-sliding":
        editor.legs[k] = replace(before, kind="entry")
        slide = with_letter(before.mode, surface, "s")
        new = leg_between(system, slide, mode_after(before))
    else:
        editor.legs[k] = replace(before, kind="crossing")
        far = with_letter(before.mode, surface, before.mode[surface].translate(TURNED))
        new = leg_between(system, far, with_letter(far, surface, "s"))
    editor.insert(k + 1, new, start)
    return editor.done(k + 1)


def _added(
    problem: BoundaryProblem, leg: Leg, guard: Guard, kind: str, y: Array, p: Array
) -> tuple[list[Leg], list[Array]] | None:
    """Legs that come before the rest of a leg that is touched, and the starts after the first."""
    system = problem.system
    if is_condition(problem, guard):
        other = with_letter(leg.mode, guard.element, _OTHER[leg.mode[guard.element]])
        return [leg_between(system, leg.mode, other), leg_between(system, other, leg.mode)], [y, y]
    if kind == "grazing-sliding":
        slide = with_letter(leg.mode, guard.element, "s")
        return [leg_between(system, leg.mode, slide), leg_between(system, slide, leg.mode)], [y, y]
    if kind in (SOFT, FORCE, CENTRE):
        far = with_letter(leg.mode, guard.element, leg.mode[guard.element].translate(TURNED))
        return [leg_between(system, leg.mode, far), leg_between(system, far, leg.mode)], [y, y]
    if kind == "adding-sliding":
        free = with_letter(leg.mode, guard.element, "+" if guard.side > 0 else "-")
        return [leg_between(system, leg.mode, free), leg_between(system, free, leg.mode)], [y, y]
    if guard.kind in ("impact", "reset"):
        hit = Leg(leg.mode, guard.kind, guard.element, guard.side, discrete=leg.discrete)
        after = hit.at_event(system, y, p).after
        return ([hit], [after]) if _stays(y, after) else None
    return None


# removed legs --------------------------------------------------------------------------------------


def _shorter(
    before: ChangedItinerary, kind: str, at: Condition, p: Array
) -> ChangedItinerary | None:
    if kind in ("impact grazing", "grazing of a reset"):
        return _missed(before, at.leg, p)
    if (
        kind == "corner"
        and at.what == "duration"
        and before.problem.legs[at.leg - 1].kind == "contact"
    ):
        return never_closed(before, at.leg, p)
    if kind == "corner" and at.what == "duration":
        cut = _once(before, at.leg, p) or cut_corner(before, at.leg, p)
        if cut is not None:
            return cut
    turned = _turned(before, at.leg, p)
    i = turned.origin.index(before.origin[at.leg])
    editor = LegEditor(turned.problem, turned.u, turned.origin)
    legs = editor.legs
    if i == 0:
        return None
    if kind in ("crossing-sliding", "switching-sliding"):
        became = "crossing" if kind == "crossing-sliding" else "entry"
        guard = _start_guard(turned.problem, legs, i)
        legs[i - 1] = replace(legs[i - 1], kind=became)
        editor.remove(i)
        return editor.done(test=Condition("start", i % len(legs), guard))
    if kind in ("grazing-sliding", "adding-sliding", SOFT, FORCE) and at.what == "duration":
        if len(legs) == 2:
            return _smooth(editor, p)
        if i + 1 == len(legs):
            return None
        guard = _guard(turned.problem, legs[i - 1])
        legs[i - 1] = replace(legs[i + 1], mode=legs[i - 1].mode)
        editor.durations[i - 1] += editor.durations[i] + editor.durations[i + 1]
        editor.remove(i + 1)
        editor.remove(i)
        return editor.done(test=Condition("interior", i - 1, guard))
    return swapped(editor, i) if kind == "corner" and at.what == "duration" else None


def _stays(y: Array, after: Array) -> bool:
    """Whether an event that is touched leaves the state, so that orbits with and without it are neighbours."""
    return bool(np.abs(after - y[: after.size]).max() <= _NEIGHBOURS * (1.0 + np.abs(y).max()))


def _again(editor: LegEditor, i: int, p: Array) -> ChangedItinerary | None:
    """The reset before leg ``i``, which leads to its own surface, happens once more; None where it moves the state."""
    again, x = replace(editor.legs[i - 1], mode=editor.legs[i].mode), editor.starts[i]
    if not _stays(x, again.at_event(editor.problem.system, x, p).after):
        return None
    editor.insert(i, again, x)
    return editor.done(i)


def _once(before: ChangedItinerary, i: int, p: Array) -> ChangedItinerary | None:
    """A reset that happens again at once, left out; None where it is another one, or moves the state."""
    editor, first = LegEditor(before.problem, before.u, before.origin), before.problem.legs[i - 1]
    leg, x = editor.legs[i], editor.starts[i]
    if (
        not first.kind == leg.kind == "reset"
        or first.element != leg.element
        or len(editor.legs) < 2
    ):
        return None
    flow = integrate_leg(before.problem.system, leg, x, editor.durations[i], p)
    if not _stays(flow.end, leg.at_event(before.problem.system, flow.end, p).after):
        return None
    editor.remove(i)
    i %= len(editor.legs)
    guards = guarded_field(before.problem.system, editor.legs[i].mode).motion.guards
    guard = next(g for g in guards if g.kind == "reset" and g.element == leg.element)
    return editor.done(test=Condition("start", i, guard))


def _missed(before: ChangedItinerary, i: int, p: Array) -> ChangedItinerary | None:
    """An impact or reset that is only touched, left out; None where it moves the state."""
    leg, (starts, durations) = before.problem.legs[i], before.problem.split(before.u)
    flow = integrate_leg(before.problem.system, leg, starts[i], float(durations[i]), p)
    if not _stays(flow.end, leg.at_event(before.problem.system, flow.end, p).after):
        return None
    count = len(before.problem.legs)
    if before.problem.legs[(i + 1) % count].repeats:
        return None  # the repeated events begin after it
    turned = rotated(before, i, p) if i + 1 == count > 1 else before
    i = 0 if turned is not before else i
    editor = LegEditor(turned.problem, turned.u, turned.origin)
    if count == 1:
        return _smooth(editor, p)
    guard = _guard(turned.problem, editor.legs[i])
    editor.legs[i] = replace(editor.legs[i + 1], mode=editor.legs[i].mode)
    editor.durations[i] += editor.durations[i + 1]
    editor.remove(i + 1)
    return editor.done(test=Condition("interior", i, guard))


#: Parts of the period after a touch at which an orbit without events may begin.
_PARTS = (0.4, 0.02, 0.1, 0.7, 0.9, 0.98)


def _smooth(editor: LegEditor, p: Array) -> ChangedItinerary:
    """An orbit left without events: its one leg gets a phase condition."""
    problem, leg, period = editor.problem, editor.legs[0], sum(editor.durations)
    guard, n = _guard(problem, leg), problem.dimension
    ends = [
        integrate_leg(problem.system, leg, editor.starts[0], part * period, p) for part in _PARTS
    ]
    # away from where it touches, which is to be inside the leg, and not where it is slow
    fastest = max(ends, key=lambda flow: float(np.linalg.norm(flow.rate[:n])))
    start, phase = fastest.end[:n], np.zeros(n)
    if problem.system.time_dependent:
        phase[-1] = 1.0
    else:
        phase = fastest.rate[:n] / np.linalg.norm(fastest.rate[:n])
    whole = replace(problem, legs=(Leg(leg.mode),), phase=phase, reference=start.copy())
    u = whole.pack(np.array([start]), np.array([period]))
    return ChangedItinerary(whole, u, (editor.origin[0],), Condition("interior", 0, guard).name)


def _guard(problem: BoundaryProblem, leg: Leg) -> Guard:
    own = leg.map(problem.system)
    assert own is not None
    return own.guard


def _start_guard(problem: BoundaryProblem, legs: Sequence[Leg], i: int) -> Guard:
    """The guard that fails where leg ``i`` vanishes: of the leg after it."""
    removed, after = legs[i], legs[(i + 1) % len(legs)]
    mode = after.mode if i + 1 < len(legs) else mode_after(removed)
    if i + 1 == len(legs) and problem.symmetry is not None:  # for the first leg
        removed, mode = mirrored(problem, removed), after.mode
    surface = surface_of(problem.system, removed)
    for guard in guarded_field(problem.system, mode).motion.guards:
        if guard.kind == "surface" and guard.element == surface and removed.kind == "exit":
            return guard
        if guard.kind == "exit" and removed.kind == "entry" and guard.element == surface:
            if guard.side == (1 if removed.mode[surface] == "+" else -1):
                return guard
    return _guard(problem, legs[i - 1])


# shared ------------------------------------------------------------------------------------------


def _turned(before: ChangedItinerary, i: int, p: Array) -> ChangedItinerary:
    """The same orbit from another leg, so that leg ``i`` has neighbours on both sides."""
    count = len(before.problem.legs)
    if 0 < i < count - 1 or (count == 2 and i == 1) or count == 1:
        return before
    return rotated(before, 1 if count == 2 else (i - 1) % count, p)


# Itineraries next to a corner, where two events occur at one time.

#: Legs that are shorter than this part of the orbit vanish.
_SHORT = 1e-7


def swapped(editor: LegEditor, i: int) -> ChangedItinerary | None:
    """Two events at one time in the other order."""
    system, (first, second) = editor.problem.system, editor.legs[i - 1 : i + 1]
    a, b = surface_of(system, first), surface_of(system, second)
    if a < 0 or b < 0 or a == b:
        return None
    between = with_letter(first.mode, b, mode_after(second)[b])
    editor.legs[i - 1] = leg_between(system, first.mode, between)
    editor.legs[i] = leg_between(system, between, with_letter(between, a, second.mode[a]))
    return editor.done(i)


def is_condition(problem: BoundaryProblem, guard: Guard) -> bool:
    """Whether a guard is y or the multiplier of a complementarity condition."""
    system, k = problem.system, guard.element
    own = guard.kind in ("surface", "release") and k < len(system.entries)
    return own and system.entries[k][0] in system.half_lines


def closed_before(editor: LegEditor, i: int, guard: Guard, p: Array) -> ChangedItinerary | None:
    """A complementarity condition closes before the event that leads to leg ``i``, where it is open again."""
    system, k = editor.problem.system, (i - 1) % len(editor.legs)
    before, own = editor.legs[k], guard.element
    if before.mode[own] != "o" or editor.legs[i].mode[own] != "o" or before.kind == "contact":
        return None
    end = integrate_leg(system, before, editor.starts[k], editor.durations[k], p).end
    closed = replace(before, mode=with_letter(before.mode, own, "c"))
    editor.legs[k] = replace(
        before, kind="contact", element=own, side=1, letters="", further=(), atom=-1
    )
    editor.insert(k + 1, closed, end[: editor.problem.dimension])
    return editor.done(k + 1)


def never_closed(before: ChangedItinerary, i: int, p: Array) -> ChangedItinerary | None:
    """A leg on which a complementarity condition is closed, until an event that opens it, left out."""
    turned = _turned(before, i, p)
    i = turned.origin.index(before.origin[i])
    editor = LegEditor(turned.problem, turned.u, turned.origin)
    first, closed, count = editor.legs[i - 1], editor.legs[i], len(editor.legs)
    own = first.element
    if count < 2 or closed.timed or editor.legs[(i + 1) % count].mode[own] != "o":
        return None
    editor.legs[i - 1] = replace(closed, mode=first.mode)
    editor.remove(i)
    guards = guarded_field(
        editor.problem.system, editor.legs[i % len(editor.legs)].mode
    ).motion.guards
    guard = next(g for g in guards if g.kind == "surface" and g.element == own)
    return editor.done(test=Condition("start", i % len(editor.legs), guard))


def round_corner(editor: LegEditor, i: int, guard: Guard, p: Array) -> ChangedItinerary | None:
    """A second surface is crossed before the crossing that leads to leg ``i``, and back after it."""
    system, k = editor.problem.system, (i - 1) % len(editor.legs)
    before, far = editor.legs[k], guard.element
    if guard.kind != "surface" or before.kind != "crossing":
        return None
    flow = integrate_leg(system, before, editor.starts[k], editor.durations[k], p)
    start = before.at_event(system, flow.end, p).after
    turned = before.mode[far].translate(TURNED)
    modes = [before.mode, with_letter(before.mode, far, turned)]
    modes += [with_letter(mode_after(before), far, turned), mode_after(before)]
    legs = [leg_between(system, a, b) for a, b in pairwise(modes)]
    editor.legs[k] = legs[0]
    editor.insert(k + 1, legs[1], start)
    editor.insert(k + 2, legs[2], start)
    return editor.done(k + 1, k + 2)


def cut_corner(before: ChangedItinerary, i: int, p: Array) -> ChangedItinerary | None:
    """Two short legs beyond a second surface, left out; None where there are no such two."""
    system, count = before.problem.system, len(before.problem.legs)
    durations = before.problem.split(before.u)[1]
    short = [
        j for j in ((i + 1) % count, (i - 1) % count) if durations[j] < _SHORT * sum(durations)
    ]
    if count < 4 or not short:
        return None
    turned = rotated(before, ((i if short[0] == (i + 1) % count else short[0]) - 1) % count, p)
    editor = LegEditor(turned.problem, turned.u, turned.origin)
    first, between, last = editor.legs[:3]
    far, own = surface_of(system, first), surface_of(system, between)
    crossed = all(leg.kind == "crossing" for leg in (first, between, last))
    if not crossed or surface_of(system, last) != far or own == far:
        return None
    editor.legs[0] = leg_between(system, first.mode, mode_after(last))
    editor.remove(2)
    editor.remove(1)
    guards = guarded_field(system, mode_after(last)).motion.guards
    guard = next(g for g in guards if g.kind == "surface" and g.element == far)
    return editor.done(test=Condition("start", 1, guard))


# Guesses for an orbit with new short legs.


def grown(problem: BoundaryProblem, u: Array, p: Array, fresh: Sequence[int], by: float) -> Array:
    """Unknowns near an orbit whose legs ``fresh`` last for ``by``."""
    # A leg that is added inside a slide begins before the point where the slide touched its boundary
    # and ends after it: h = L11 t^2/2 + L111 t^3/6 with an exit at -t/3 of a leg of the duration t.
    # A slide that begins at a graze ends where the graze was; a visit beyond a soft switch is around it.
    starts, durations = (np.array(part) for part in problem.split(u))
    legs = problem.legs
    for i in fresh:
        durations[i] = by
        kinds = (legs[i - 1].kind, legs[i].kind) if 0 < i < len(legs) - 1 else ("", "")
        ahead = {("exit", "entry"): by / 3, ("entry", "exit"): by, ("crossing", "crossing"): by / 2}
        before = ahead.get(kinds, 0.0)
        through = kinds == ("exit", "entry") or legs[i - 1].mode == mode_after(legs[i])
        if not before or not through or durations[i - 1] < by or durations[i + 1] < by:
            continue
        durations[i - 1] -= before
        durations[i + 1] -= by - before
        for k in (i - 1, i):
            flow = integrate_leg(problem.system, legs[k], starts[k], float(durations[k]), p)
            starts[k + 1] = flow.end[: problem.dimension]
    return problem.pack(starts, durations)


# Leaving an event ---------------------------------------------------------------------------------

#: Durations of new legs, or distances along the curve, with which it leaves an event, relative to the orbit.
_STARTS = (1e-4, 1e-3, 1e-2, 1e-5)


def departures(curve: Any, u: Array, fresh: Sequence[int]) -> list[Departure]:
    """Ways to leave an event to the side where the itinerary is admissible, new legs growing from zero."""
    for size in _STARTS:
        ways: list[tuple[Array, Array]] = []
        tangent = None
        try:
            tangent = np.linalg.svd(curve.scaled(u / curve.scale)[1])[2][-1]
        except (NonsmoothError, np.linalg.LinAlgError):  # no derivatives there
            if not fresh:
                return []
        if fresh:
            problem, axis = curve.problem, np.zeros(u.size)
            axis[[problem.size - len(problem.legs) + i for i in fresh]] = len(fresh) ** -0.5
            by = size * float(curve.scale[problem.size - 1])
            ways.append((curve.grown(u, fresh, by), axis))
        if tangent is not None:
            ways += [(u + s * size * tangent * curve.scale, tangent) for s in (1.0, -1.0)]
        result = list[Departure]()
        for guess, axis in ways:
            found = curve.correct(guess, axis)
            if found is None or np.abs((found - u) / curve.scale).max() > 0.2:
                continue
            if not curve.faults(found):
                step = (found - u) / curve.scale
                result.append(Departure(curve, [u, found], step / np.linalg.norm(step)))
                if fresh:
                    break
        if result:
            return result
    return []
