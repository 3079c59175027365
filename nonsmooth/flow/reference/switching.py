"""Filippov's logic at a point of one or several surfaces: which motions can continue from here.

A mode can continue if each of its guards that vanishes here becomes positive at once: its first
nonzero Taylor coefficient is positive. For a side that is "the field leaves to this side", for
sliding it is "both fields point at the surface". One such mode: the motion continues in it. More
than one: the future is not unique. The coefficients that are zero by construction are dropped, so
there is no push off the surface by an epsilon.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ...model import Array
from ...model.laws import complementarity
from ...model.laws.frozen import Frozen
from .. import messages
from ..constants import TANGENT, VANISHES
from ..status import Status
from .laws_of_sets import bounded_multipliers
from .modes import Expansion, Modes
from .stepper import Stepper

#: Number of leading coefficients of a guard that vanish by construction, by (kind, surface, side).
Known = Mapping[tuple[str, int, int], int]

#: Modes that are tried one by one where the rates do not decide, and surfaces of which all are tried
#: where no matrix is known to have one solution.
_TRIED, _FEW = 256, 3


@dataclass(frozen=True)
class Continuation:
    """A mode that can continue, and the coefficients to drop from its guards in the first step.

    ``unknowns`` are the multipliers of the surfaces that slide, where they are not eliminated.
    """

    mode: str
    drops: dict[int, int]
    strict: bool
    unknowns: Array


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
    kept: Array | None = None,
) -> Decision:
    """Choose the motion that continues from a point of the surfaces ``active``."""
    if not active:
        carried = stepper.modes.solutions(mode, x, True, kept) if stepper.system.sets else []
        return Decision(Continuation(mode, {}, True, *(carried or [np.zeros(len(mode))])))
    first = stepper.system.surface_count  # of the contacts
    contacts = [i - first for i in active if i >= first]
    if len(active) == 1 and not contacts and is_two_fold(stepper.modes, mode, x, active[0]):
        return Decision(
            None, Status.NON_UNIQUE, messages.two_fold(stepper.system.entry_of(active[0]))
        )
    if any(i in stepper.system.set_of for i in active):
        letters = _of_sets(stepper, x, mode, active, known, kept)
    else:
        letters = _by_rates(stepper, x, mode, active, known)
    if isinstance(letters, Decision):
        return letters
    units = stepper.system.set_of
    found = [
        c
        for m in _spelled(mode, active, letters, units)
        for c in _continuations(stepper, x, m, active, known, kept)
    ]
    strict = [c for c in found if c.strict]
    if layer is not None and stepper.system.hidden and len(active) == 1:
        strict = _through_layer(strict, active[0], *layer)
    if len(strict) == 1 or (not strict and len(found) == 1):
        return Decision((strict or found)[0])
    if len(strict) > 1:
        modes = [stepper.system.spelled(c.mode) for c in strict]
        if len(set(modes)) == 1:
            return Decision(None, Status.NON_UNIQUE, messages.several_directions(len(modes)))
        return Decision(None, Status.NON_UNIQUE, messages.ambiguous(modes))
    resting = [c for c in found if "s" in c.mode or "c" in c.mode]
    if resting:
        return Decision(resting[0])
    if contacts:
        names = [stepper.system.impacts[j] for j in contacts]
        return Decision(None, Status.INCONSISTENT, messages.no_reaction(names))
    called = stepper.system.surface_names
    of_sets = [called[i] for i, members in units.items() if i in active and i == members[0]]
    if of_sets:
        return Decision(None, Status.NON_UNIQUE, messages.undetermined(of_sets))
    if len(active) == 2 and stepper.modes.spirals_in(mode, x, active):
        return _held_there(stepper, x, mode, active)
    if len(active) > 1:
        return Decision(
            None, Status.INTERSECTION, messages.no_stable_motion(_entries(stepper, active))
        )
    if not known and (ends := _where_sliding_ends(stepper, x, mode, active[0])):
        return decide(stepper, x, mode, active, ends, layer, kept)
    return Decision(None, Status.NON_UNIQUE, messages.degenerate())


def _where_sliding_ends(stepper: Stepper, x: Array, mode: str, surface: int) -> Known:
    """Coefficients that vanish where the multiplier of a surface is at its bound, to rounding."""
    slides = mode[:surface] + "s" + mode[surface + 1 :]
    for unknowns in stepper.modes.solutions(slides, x, False):
        e = stepper.expand(slides, x, unknowns)
        for row, guard in enumerate(stepper.guards(slides)):
            at_end = guard.kind == "exit" and guard.index == surface
            if at_end and e.finite and stepper.leading(e, row, 0)[0]:
                return {("exit", surface, guard.side): 1, ("surface", surface, guard.side): 2}
    return {}


def _entries(stepper: Stepper, active: Sequence[int]) -> list[int]:
    """Numbers of the surfaces and sets to which switching functions belong."""
    entries = stepper.system.entries
    return [k for k, members in enumerate(entries) if any(i in active for i in members)]


def _held_there(stepper: Stepper, x: Array, mode: str, active: Sequence[int]) -> Decision:
    """Stay where two surfaces meet though no layer attracts: all orbits spiral in, so none leaves."""
    letters = "".join("s" if i in active else letter for i, letter in enumerate(mode))
    found = stepper.modes.solutions(letters, x, stable_only=False)
    if len(found) != 1:
        return Decision(
            None, Status.INTERSECTION, messages.no_stable_motion(_entries(stepper, active))
        )
    return Decision(Continuation(letters, {}, True, found[0]))


def _by_rates(
    stepper: Stepper, x: Array, mode: str, active: Sequence[int], known: Known
) -> dict[int, str] | Decision:
    """Letters that are possible: one where the rates decide, else all."""
    # A surface or contact that is being left has a multiplier at its bound, to the tolerance of the run:
    # its rates decide nothing.
    first = stepper.system.surface_count
    leaving = {j + first * (kind in ("impact", "release")) for kind, j, _ in known}
    undecided = {i: "+-s" if i < first else "oc" for i in active}
    if len(active) < 2:
        return undecided
    problem = stepper.modes.rates(mode, x, active)
    if problem is None:
        return undecided if _choices(undecided) <= _TRIED else _too_many(stepper, active)
    a, m, scales = problem
    if complementarity.is_unique(m):
        guess = np.array([{"+": 1.0, "-": -1.0, "o": -1.0}.get(mode[i], 0.0) for i in active])
        lam = complementarity.solve(a, m, guess, [i >= first for i in active])
    else:
        if len(active) <= _FEW or max(active) >= first:
            return undecided if _choices(undecided) <= _TRIED else _too_many(stepper, active)
        found = complementarity.all_solutions(a, m)
        if found is None or len(found) > 1:
            return _too_many(stepper, active)
        lam = found[0] if found else None
    if lam is None:
        return Decision(
            None, Status.INTERSECTION, messages.no_stable_motion(_entries(stepper, active))
        )
    rates = a + m @ lam
    clear_rate = np.abs(rates) > VANISHES * (scales + np.abs(m).sum(axis=1))
    room = np.where(np.array(active) < first, 1.0 - np.abs(lam), lam)
    inside = room > VANISHES * (1.0 + scales / np.abs(np.diag(m)))
    for k, i in enumerate(active):
        if i in leaving:
            continue
        if inside[k]:
            undecided[i] = "s" if i < first else "c"
        elif clear_rate[k]:
            undecided[i] = "o" if i >= first else ("+" if lam[k] > 0.0 else "-")
    if _choices(undecided) > _TRIED:
        return _too_many(stepper, active)
    return undecided


def _of_sets(
    stepper: Stepper,
    x: Array,
    mode: str,
    active: Sequence[int],
    known: Known,
    kept: Array | None,
) -> dict[int, str] | Decision:
    """Letters that are possible where sets of codimension two and more are met."""
    system = stepper.system
    undecided = {
        i: "sl" if i in system.set_of else "+-s" if i < system.surface_count else "oc"
        for i in active
    }
    own = [i for i in active if i in system.set_of]
    law = stepper.modes.frozen(mode, x, own, kept)
    if law is None or not np.all(np.isfinite(law.m)):
        return undecided
    first = [i for i in own if i == system.set_of[i][0]]
    places = {i: [own.index(j) for j in system.set_of[i]] for i in first}
    for i, where in places.items():
        if Frozen(law.a[where], law.m[np.ix_(where, where)]).indefinite:
            message = messages.indefinite(system.surface_names[i])
            return Decision(None, Status.NON_UNIQUE, message)
    leaving = {j for kind, j, _ in known if kind == "slip"}
    lam = bounded_multipliers(law, [len(where) for where in places.values()])
    if len(own) == len(active) and lam is not None:
        rates = law.a - law.m @ lam
        for i, where in places.items():
            room = 1.0 - float(np.linalg.norm(lam[where]))
            size = float(np.abs(law.a[where]).sum() + np.abs(law.m[where]).sum())
            moves = float(np.linalg.norm(rates[where])) > 1e-9 * size
            letter = "s" if room > 1e-9 else "l" if moves else "sl"
            for j in system.set_of[i] if i not in leaving else ():
                undecided[j] = letter
    choices = {i: undecided[i] for i in active if i not in own or i in first}
    return undecided if _choices(choices) <= _TRIED else _too_many(stepper, active)


def _choices(letters: Mapping[int, str]) -> int:
    """Number of the modes that are possible."""
    return math.prod(len(possible) for possible in letters.values())


def _too_many(stepper: Stepper, active: Sequence[int]) -> Decision:
    entries = _entries(stepper, active)
    return Decision(None, Status.NON_UNIQUE, messages.possibly_several(entries))


def _spelled(
    mode: str,
    active: Sequence[int],
    letters: dict[int, str],
    sets: Mapping[int, tuple[int, ...]],
) -> Iterable[str]:
    units = list(dict.fromkeys(sets.get(i, (i,)) for i in active))
    for choice in product(*(letters[unit[0]] for unit in units)):
        candidate = list(mode)
        for unit, letter in zip(units, choice, strict=True):
            for i in unit:
                candidate[i] = letter
        yield "".join(candidate)


def _continuations(
    stepper: Stepper,
    x: Array,
    mode: str,
    active: Sequence[int],
    known: Known,
    kept: Array | None,
) -> Iterable[Continuation]:
    for unknowns in stepper.modes.solutions(mode, x, True, kept):
        continuation = _continuation(stepper, x, unknowns, mode, active, known)
        if continuation is not None:
            yield continuation


def _continuation(
    stepper: Stepper, x: Array, unknowns: Array, mode: str, active: Sequence[int], known: Known
) -> Continuation | None:
    e = stepper.expand(mode, x, unknowns)
    if not e.finite:
        e = _finite_prefix(e)
    drops, strict = {}, True
    first = stepper.system.surface_count
    for row, guard in enumerate(stepper.guards(mode)):
        contact = guard.kind in ("impact", "release")
        if guard.kind == "near" and mode[guard.index] == "s":
            continue  # ends steps only
        if guard.kind in ("stop", "reset") or guard.index + first * contact not in active:
            continue
        zeros = known.get((guard.kind, guard.index, guard.side), 0)
        zeros = max(zeros, {"surface": 1, "near": 1, "impact": 2}.get(guard.kind, 0))
        k, value = stepper.leading(e, row, zeros)
        if value < 0.0:
            return None
        if value == 0.0:
            strict = False
        drops[row] = min(k, e.guards.shape[1] - 1) if value else e.guards.shape[1]
    return Continuation(mode, drops, strict, unknowns)


def _through_layer(
    found: Sequence[Continuation], surface: int, origin: float, direction: int
) -> list[Continuation]:
    """First equilibrium of the layer problem that lambda meets on its way, if any (Jeffrey 2018)."""

    def ahead(c: Continuation) -> float:
        letter = c.mode[surface]
        lam = float(c.unknowns[surface]) if letter == "s" else (1.0 if letter == "+" else -1.0)
        return (lam - origin) * direction

    return sorted((c for c in found if ahead(c) > 1e-5), key=ahead)[:1]


def _finite_prefix(e: Expansion) -> Expansion:
    """Zero the coefficients that are not finite: they decide nothing."""
    states, guards = e.states.copy(), e.guards.copy()
    for c in (states, guards):
        c[~np.isfinite(c)] = 0.0
    return replace(e, states=states, guards=guards, finite=False)


def is_two_fold(modes: Modes, mode: str, x: Array, surface: int, tolerance: float = 0.0) -> bool:
    """Whether both fields are tangent to a surface at a point, and the sliding field 0/0."""
    # ``tolerance`` is on the angles between fields and surface; rounding is always allowed.
    angles = modes.angles(mode, x, surface)
    return angles is not None and bool(np.all(np.abs(angles) <= tolerance + TANGENT))
