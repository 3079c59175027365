"""Runs of one system with every kind of event, by an integrator that shares no code with the package.

A system is data (``Problem``): expressions as strings, evaluated here with numbers of Python, and by
``package_system`` with symbols of CasADi. Derivatives are complex steps, steps are those of Dormand and
Prince of order 8, and an event is the root of the guard along a step that is taken anew for each guess.
At an event every combination of letters is tried; with ``hidden`` the multiplier moves through its layer.
Jumps follow the contract of events: stored sides of atoms, pending events, one jump at a time.
What is too close to call ends a run with ``trouble``.
"""

from __future__ import annotations

import cmath
import math
import re
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

_TOLERANCE = 1e-13
_CLOSE = 1e-7  # rates, multipliers and guards closer than this to a limit decide nothing
_REACHED = 1e-10  # a set is reached at this distance
_NAMES = ("sin", "cos", "exp", "tanh", "sqrt")


@dataclass(frozen=True)
class Jump:
    """A reset: ``target`` names the states that change."""

    guard: str
    target: dict[str, str]
    direction: int = 0
    name: str = "jump"
    level: bool = False
    when: str = ""  # holds where it is not negative
    priority: float = 0.0
    other: str = ""  # the condition is this one too, or either: not negative
    either: bool = False


@dataclass(frozen=True)
class Contact:
    """A gap, its rate without multipliers, and Newton's restitution; reaction k is ``rk`` in the field."""

    gap: str
    rate: str
    restitution: str = "0.0"


@dataclass(frozen=True)
class Table:
    """A curve of straight lines, that continue beyond its ends."""

    argument: str
    xs: list[float]
    ys: list[float]


@dataclass(frozen=True)
class Problem:
    """A system, a start and an end; multiplier i is ``li`` in the field, and ``numbers`` are parameters."""

    states: list[str]
    field: list[str]
    start: list[float]
    t_end: float
    surfaces: list[str] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)
    stops: list[tuple[str, int]] = field(default_factory=list)
    hidden: bool = False
    numbers: dict[str, float] = field(default_factory=dict)
    discrete: list[str] = field(default_factory=list)  # the last states
    tables: list[Table] = field(default_factory=list)  # table j is ``tabj`` in the field
    sets: list[tuple[str, str]] = field(
        default_factory=list
    )  # one at most; its multiplier is (u0, u1)


@dataclass
class Outcome:
    """Events as (time, what, mode after), last state, status, and why a run is not decided."""

    events: list[tuple[float, str, str]]
    x: np.ndarray
    t: float
    status: str
    trouble: str = ""


class Undecided(Exception):
    """Two things too close to tell apart in doubles."""


def _compiled(p: Problem, expressions: list[str], arguments: list[str], names: Any) -> Any:
    """One function of all expressions."""
    space = {name: getattr(names, name) for name in _NAMES} | p.numbers
    return eval(f"lambda {', '.join(arguments)}: [{', '.join(expressions)}]", space)


def by_kinks(p: Problem) -> Problem:
    """A problem whose breakpoints of tables are surfaces, after the others."""
    surfaces, texts = list(p.surfaces), {}
    for j, table in enumerate(p.tables):
        slopes = np.diff(table.ys) / np.diff(table.xs)
        text = f"({table.ys[0]}+({slopes[0]})*({table.argument}-({table.xs[0]}))"
        for x, turn in zip(table.xs[1:-1], np.diff(slopes), strict=True):
            text += f"+({turn / 2})*(1+l{len(surfaces)})*({table.argument}-({x}))"
            surfaces.append(f"{table.argument}-({x})")
        texts[f"tab{j}"] = text + ")"
    fields = [re.sub(r"\btab\d\b", lambda found: texts[found[0]], f) for f in p.field]
    return replace(p, field=fields, surfaces=surfaces, tables=[])


class Model:
    """Numbers of a problem: field, outputs that multipliers act on, and guards."""

    def __init__(self, given: Problem):
        p = self.problem = by_kinks(given)
        self.n, self.m, self.c = len(p.states), len(p.surfaces), len(p.contacts)
        self.own, self.vectors = len(given.surfaces), len(p.sets)
        unknowns = [f"l{i}" for i in range(self.m)] + [f"r{k}" for k in range(self.c)]
        unknowns += ["u0", "u1"] * self.vectors
        products = any(
            f"l{i}*l{j}" in f for f in p.field for i in range(self.m) for j in range(self.m)
        )
        self.affine = not (p.hidden or products)
        self._field = _compiled(p, p.field, [*p.states, "t", *unknowns], math)
        outputs = [*p.surfaces, *[contact.rate for contact in p.contacts]]
        outputs += [h for one in p.sets for h in one]
        self._vector = _compiled(p, [h for one in p.sets for h in one], [*p.states, "t"], math)
        self._complex = _compiled(p, outputs, [*p.states, "t"], cmath)
        self.atoms = [*[g for g, _ in p.stops], *[j.guard for j in p.jumps]]
        self.atoms += [j.when for j in p.jumps if j.when] + [j.other for j in p.jumps if j.other]
        gaps = [contact.gap for contact in p.contacts]
        self._guards = _compiled(p, [*p.surfaces, *gaps, *self.atoms], [*p.states, "t"], math)
        kept = [contact.restitution for contact in p.contacts]
        self.restitutions = _compiled(p, kept, [], math)()
        self._atoms = _compiled(p, self.atoms, [*p.states, "t"], cmath)
        self.maps = [
            _compiled(p, [j.target.get(s, s) for s in p.states], [*p.states, "t"], math)
            for j in p.jumps
        ]

    def field(self, x: np.ndarray, t: float, unknown: np.ndarray) -> np.ndarray:
        return np.array(self._field(*x.tolist(), t, *unknown.tolist()))

    def gradients(self, x: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Gradients of surfaces and of rates of gaps, and their derivatives by time."""
        step, given = 1e-30j, [*x.tolist(), t]
        columns = []
        for j in range(self.n + 1):
            moved = list(given)
            moved[j] += step
            columns.append([complex(value).imag / 1e-30 for value in self._complex(*moved)])
        matrix = np.array(columns).T.reshape(-1, self.n + 1)
        return matrix[:, :-1], matrix[:, -1]

    def rates(self, x: np.ndarray, t: float, unknown: np.ndarray) -> np.ndarray:
        """Rates of surfaces, accelerations of gaps."""
        gradient, by_time = self.gradients(x, t)
        return gradient @ self.field(x, t, unknown) + by_time

    def slopes(
        self, x: np.ndarray, t: float, unknown: np.ndarray, held: list[int], gradient: np.ndarray
    ) -> np.ndarray:
        """Derivatives of rates by the unknowns of held elements; exact where the field is linear in each."""
        size = 1e-4 if self.problem.hidden else 1.0
        columns = []
        for i in held:
            ahead, back = unknown.copy(), unknown.copy()
            ahead[i] += size
            back[i] -= size
            columns.append((self.field(x, t, ahead) - self.field(x, t, back)) / (2 * size))
        return gradient[held] @ np.array(columns).T

    def unknowns(
        self, x: np.ndarray, t: float, mode: tuple[int, ...], guess: np.ndarray
    ) -> np.ndarray:
        """Multipliers and reactions of a mode, by Newton's method from a guess."""
        size = self.m + self.c
        held = [i for i, letter in enumerate(mode[:size]) if letter == 0]
        unknown = np.zeros(size + 2 * self.vectors)
        unknown[: self.m] = mode[: self.m]
        if mode[size:] == (0,):
            held += [size, size + 1]
        elif mode[size:]:
            h = self.vector(x, t)
            unknown[size:] = h / np.linalg.norm(h)
        if not held:
            return unknown
        unknown[held] = guess[held]
        gradient, by_time = self.gradients(x, t)
        slope = None
        for _ in range(30):
            rate = gradient[held] @ self.field(x, t, unknown) + by_time[held]
            if slope is None or not self.affine:
                slope = self.slopes(x, t, unknown, held, gradient)
            change = np.linalg.solve(slope, rate)
            unknown[held] -= change
            if np.abs(change).max() < 1e-14 * (1 + np.abs(unknown).max()):
                return unknown
        raise Undecided("multipliers do not converge")

    def vector(self, x: np.ndarray, t: float) -> np.ndarray:
        """The function of the set."""
        return np.array(self._vector(*x.tolist(), t))

    def guards(self, x: np.ndarray, t: float) -> np.ndarray:
        """Surfaces, gaps and atoms."""
        return np.array(self._guards(*x.tolist(), t))

    def atom_rates(self, x: np.ndarray, t: float, f: np.ndarray) -> np.ndarray:
        """Rates of atoms along a field."""
        moved = self._atoms(*(x + 1e-30j * f).tolist(), t + 1e-30j)
        return np.array([complex(value).imag / 1e-30 for value in moved])


class Run:
    """One run; a mode has +1, -1, 0 (slides) for surfaces and 1 (open), 0 (closed) for contacts."""

    def __init__(self, problem: Problem):
        self.model = model = Model(problem)
        self.problem, self.x, self.t = problem, np.array(problem.start, float), 0.0
        values = model.guards(self.x, 0.0)
        if np.abs(values).min(initial=1.0) < _CLOSE:
            raise Undecided("a start on a zero")
        signs = np.sign(values).astype(int)
        self.mode = tuple(signs[: model.m]) + (1,) * (model.c + model.vectors)
        self.side = signs[model.m + model.c :]
        self.unknown = self._guess = np.zeros(model.m + model.c + 2 * model.vectors)
        count = len(problem.stops) + len(problem.jumps)
        filtered = [j for j, jump in enumerate(problem.jumps) if jump.when]
        joined = [j for j, jump in enumerate(problem.jumps) if jump.other]
        self._conditions = [
            {j: at + first for at, j in enumerate(own)}
            for own, first in ((filtered, count), (joined, count + len(filtered)))
        ]
        self.events: list[tuple[float, str, str]] = []
        self.fresh: set[int] = set()  # rows of ``_room`` that start at zero
        self.status = ""
        self.step = 1e-3

    def word(self, mode: tuple[int, ...] | None = None) -> str:
        mode = self.mode if mode is None else mode
        letters, m, size = {1: "+", -1: "-", 0: "s"}, self.model.m, self.model.m + self.model.c
        sets = ["s*"[letter] for letter in mode[size:]]
        contacts = ["co"[letter] for letter in mode[m:size]]
        return "".join([letters[letter] for letter in mode[: self.model.own]] + sets + contacts)

    def run(self) -> Outcome:
        trouble = ""
        try:
            self._instant(None)
            while not self.status:
                self._advance()
                times = [at for at, what, _ in self.events if what.startswith("jump")]
                gaps = np.diff(np.unique(times)[-4:])
                if len(gaps) == 3 and 0 < gaps[2] < 1e-7 and gaps[2] < gaps[1] < gaps[0]:
                    raise Undecided("jumps accumulate")
        except (Undecided, np.linalg.LinAlgError, OverflowError, ValueError) as error:
            trouble = f"{type(error).__name__}: {error}"
        return Outcome(self.events, self.x, self.t, self.status, trouble)

    # motion

    def _slope(self, x: np.ndarray, t: float) -> np.ndarray:
        self.unknown = self.model.unknowns(x, t, self.mode, self.unknown)
        return self.model.field(x, t, self.unknown)

    def _stepped(self, h: float) -> tuple[np.ndarray, float, np.ndarray]:
        """After one step of Dormand and Prince: state, error relative to the tolerance, slope."""
        self.unknown, slopes = self._guess.copy(), np.zeros((13, self.model.n))
        slopes[0] = self._slope(self.x, self.t)
        for s in range(1, 12):
            moved = self.x + h * (DOP853.A[s, :s] @ slopes[:s])
            slopes[s] = self._slope(moved, self.t + h * DOP853.C[s])
        y = self.x + h * (DOP853.B @ slopes[:12])
        slopes[12] = self._slope(y, self.t + h)
        scale = _TOLERANCE * (1 + np.maximum(np.abs(self.x), np.abs(y)))
        five, three = slopes.T @ DOP853.E5 / scale, slopes.T @ DOP853.E3 / scale
        norm = np.hypot(np.linalg.norm(five), 0.1 * np.linalg.norm(three))
        error = abs(h) * np.linalg.norm(five) ** 2 / (norm or 1.0) / math.sqrt(self.model.n)
        return y, error, slopes[12]

    def _room(self, x: np.ndarray, t: float) -> np.ndarray:
        """Positive in the mode: surfaces and gaps, both bounds of multipliers, atoms, stability."""
        m, c = self.model.m, self.model.c
        values, growth = self.model.guards(x, t), -1.0
        room = list(values[: m + c] * self.mode[: m + c]) + [1.0] * (m + c)
        size = np.linalg.norm(self.model.vector(x, t)) - _REACHED
        if 0 in self.mode:
            unknown = self.model.unknowns(x, t, self.mode, self._guess)
            growth = self._growth(x, t, self.mode, unknown)
            if self.mode[m + c :] == (0,):
                size = 1 - np.linalg.norm(unknown[m + c :])
            for i, letter in enumerate(self.mode[: m + c]):
                if letter == 0:
                    room[i] = 1 - unknown[i] if i < m else unknown[i]
                    room[m + c + i] = 1 + unknown[i] if i < m else 1.0
        room += list(values[m + c :] * np.where(self.side == 0, 1, self.side))
        return np.array([*room, *[size] * self.model.vectors, -growth])

    def _between(
        self, h: float, part: float, begin: np.ndarray, y: np.ndarray, end: np.ndarray
    ) -> np.ndarray:
        """State inside a step to fourth order, to look for changes of sign."""
        u, v = part, 1 - part
        ends = (1 + 2 * u) * v * v * self.x + u * u * (3 - 2 * u) * y
        return ends + h * (u * v * v * begin - u * u * v * end)

    def _ahead(self, h: float) -> np.ndarray:
        """Room after a step."""
        return self._room(self._stepped(h)[0], self.t + h)

    def _growth(self, x: np.ndarray, t: float, mode: tuple[int, ...], unknown: np.ndarray) -> float:
        """Growth across the layers of the sliding surfaces; negative if they attract."""
        m = self.model.m
        held = [i for i, letter in enumerate(mode[: m + self.model.c]) if letter == 0]
        slides = sum(i < m for i in held)
        if not slides:
            return -1.0
        gradient, _ = self.model.gradients(x, t)
        slope = self.model.slopes(x, t, unknown, held, gradient)
        matrix = slope[:slides, :slides]
        if slides < len(held):  # reactions follow the multipliers at once
            inner = np.linalg.solve(slope[slides:, slides:], slope[slides:, :slides])
            matrix = matrix - slope[:slides, slides:] @ inner
        if slides == 1:
            return float(matrix[0, 0])
        return float(np.linalg.eigvals(matrix).real.max())

    def _advance(self) -> None:
        """Take one step, up to the first event in it."""
        parts, start = np.array([0.25, 0.5, 0.75, 1.0]), self._room(self.x, self.t)
        begin = self._slope(self.x, self.t)
        last = self.problem.t_end - self.t
        h = min(self.step, 0.02 * self.problem.t_end, last)
        while True:
            if h < 1e-12 and h < last:
                raise Undecided("steps do not end")
            try:
                y, error, slope = self._stepped(h)
                if not np.all(np.isfinite(y)) or error > 1:
                    h *= max(0.2, 0.9 * error**-0.125) if math.isfinite(error) else 0.2
                    continue
                between = [self._between(h, part, begin, y, slope) for part in parts[:-1]]
                rooms = np.array([
                    self._room(state, self.t + h * part)
                    for state, part in zip([*between, y], parts, strict=True)
                ])  # fmt: skip
            except (Undecided, np.linalg.LinAlgError, OverflowError):
                h /= 2
                continue
            crossed = [row for row in range(rooms.shape[1]) if (rooms[:, row] < 0).any()]
            if any(row in self.fresh and rooms[0, row] < 0 for row in crossed):
                h /= 4
                continue
            if self._dips(start, rooms, crossed) and h > 1e-3 * self.problem.t_end:
                h /= 2
                continue
            break
        self.step = h * min(2.5, 0.9 * max(error, 1e-10) ** -0.125)
        if not crossed:
            self.x, self.t = y, self.t + h
            self._accept()
            self.fresh = set()
            if h == last:
                self.status = "REACHED_END"
            return
        roots = []
        for row in crossed:
            k = int(np.argmax(rooms[:, row] < 0))
            low = parts[k - 1] if k else 0.0
            value = self._ahead(h * low)[row] if k else start[row]
            if value <= 0:
                raise Undecided("a guard that should leave zero does not")
            if self._ahead(h * parts[k])[row] >= 0:
                raise Undecided("a guard that is nearly touched")
            ahead = lambda s, row=row: self._ahead(h * s)[row]
            root = brentq(ahead, low, parts[k], xtol=1e-16, maxiter=1000)
            roots.append((root, row))
        roots.sort()
        if len(roots) > 1 and (roots[1][0] - roots[0][0]) * h < 1e-9:
            raise Undecided("two events at once")
        at, row = roots[0]
        self.x, self.t = self._stepped(h * at)[0], self.t + h * at
        others = np.delete(self._room(self.x, self.t), [row, *[r for r in self.fresh if r != row]])
        if np.abs(others).min() < _CLOSE:
            raise Undecided("another guard is nearly zero")
        self.fresh, self.step = set(), 1e-3
        self._accept()
        self._event(row)
        self._accept()

    def _accept(self) -> None:
        """Keep the unknowns as the guess of the next step."""
        self.unknown = self.model.unknowns(self.x, self.t, self.mode, self._guess)
        self._guess = self.unknown.copy()

    def _dips(self, start: np.ndarray, rooms: np.ndarray, crossed: list[int]) -> bool:
        """Whether a guard may vanish twice between the points at which it is known."""
        lowest = np.vstack([start, rooms])
        inner = lowest[1:-1]
        bend = np.abs(lowest[2:] - 2 * inner + lowest[:-2])
        near = (inner < np.minimum(lowest[:-2], lowest[2:])) & (inner < bend)
        near[:, crossed] = False
        return bool(near.any())

    # events

    def _event(self, row: int) -> None:
        m, c = self.model.m, self.model.c
        if row == 2 * (m + c) + len(self.side) + self.model.vectors:
            self.status = "INTERSECTION"
        elif row == 2 * (m + c) + len(self.side):
            self._meet_set()
        elif row >= 2 * (m + c):
            self._instant(row - 2 * (m + c))
        elif row < m + c and self.mode[row] != 0 and row >= m:
            self._instant(None, row)
        else:
            held = row % (m + c)
            bound = {} if self.mode[held] else {held: -1 if row >= m + c else 1}
            self._settle([held], bound)

    def _impact(self, k: int) -> float | None:
        """Apply Newton's law to one contact; return when it closes, where its speed is small."""
        if 0 in self.mode[self.model.m : self.model.m + self.model.c]:
            raise Undecided("an impact beside a closed contact")
        gradient, _ = self.model.gradients(self.x, self.t)
        unknown = np.array(self.unknown)
        unknown[k] = 1.0
        along = self.model.field(self.x, self.t, unknown)
        unknown[k] = 0.0
        along -= self.model.field(self.x, self.t, unknown)
        rate = self._rate(k)
        if rate > -1e-9:
            raise Undecided("an impact without speed")
        restitution = self.model.restitutions[k - self.model.m]
        kept = restitution if rate < -1e-6 else 0.0
        self.x = self.x - (1 + kept) * rate / (gradient[k] @ along) * along
        if kept:
            return None
        falls = -self.model.rates(self.x, self.t, unknown)[k]
        left = -2 * rate * restitution / (1 - restitution) / falls if restitution else 0.0
        return float(self.t + left)

    def _rate(self, k: int) -> float:
        """Rate of a gap."""
        p = self.problem
        rate = _compiled(p, [p.contacts[k - self.model.m].rate], [*p.states, "t"], math)
        return rate(*self.x.tolist(), self.t)[0]

    def _instant(self, passing: int | None, impact: int | None = None) -> None:
        """Serve jumps at one instant, section 4 of the contract."""
        p, stops = self.problem, len(self.problem.stops)
        side, view = self.side.copy(), self.side.copy()
        turned = set() if passing is None else {passing}
        for a in turned:
            view[a] = -view[a]
        whens, others = self._conditions
        order = [("stop", k) for k in range(stops)]
        order += [
            ("jump", j) for j in sorted(range(len(p.jumps)), key=lambda j: -p.jumps[j].priority)
        ]

        def parts(kind: str, k: int) -> tuple[int, int]:
            return (k, p.stops[k][1]) if kind == "stop" else (stops + k, p.jumps[k].direction)

        def holds(kind: str, k: int, sides: np.ndarray, d: int = 0) -> bool:
            a, direction = parts(kind, k)
            own = bool(sides[a] == (d or direction))
            if kind == "stop" or k not in others:
                return own
            too = bool(sides[others[k]] == 1)
            return own or too if p.jumps[k].either else own and too

        def due(before: np.ndarray, before2: np.ndarray, but: tuple[str, int] | None) -> set:
            found = set()
            for kind, k in order:
                if (kind, k) == but or (kind == "jump" and p.jumps[k].level):
                    continue
                _, direction = parts(kind, k)
                for d in [direction] if direction else [1, -1]:
                    if holds(kind, k, view, d) and not any(
                        holds(kind, k, sides, d) for sides in (before, before2)
                    ):
                        found.add((kind, k, d))
            return found

        pending, first, jumps, zeros, closing = due(side, side, None), True, 0, set(), []
        while True:
            pending = {e for e in pending if holds(e[0], e[1], view, e[2])}
            served = None
            for kind, k in order:
                level = kind == "jump" and p.jumps[k].level
                a, _ = parts(kind, k)
                if kind == "jump" and k in whens and view[whens[k]] < 0:
                    continue
                if any(e[:2] == (kind, k) for e in pending):
                    served = (kind, k)
                elif (
                    level
                    and holds(kind, k, view)
                    and (first or not ({a, whens.get(k), others.get(k)} & zeros))
                ):
                    served = (kind, k)
                if served:
                    break
            if served is None and impact is not None:
                served = ("impact", impact)
            if served is None:
                if first and not jumps and passing is None:
                    break  # nothing at the start
                if jumps:
                    self._settle(closing, {}, moved=True)
                if self.status:
                    break
                slope = self._slope(self.x, self.t)
                rates = self.model.atom_rates(self.x, self.t, slope)
                before, before2 = side.copy(), view.copy()
                for a in zeros | turned:
                    if abs(rates[a]) < _CLOSE:
                        raise Undecided("a rate after a jump is nearly zero")
                    side[a] = view[a] = int(np.sign(rates[a]))
                new = due(before, before2, None)
                pending |= new
                leveled = any(
                    j.level and holds("jump", k, view) and not (k in whens and view[whens[k]] < 0)
                    for k, j in enumerate(p.jumps)
                )
                self.fresh |= {2 * (self.model.m + self.model.c) + a for a in zeros | turned}
                zeros, turned = set(), set()
                if not new and not leveled:
                    break
                first = False
                continue
            kind, k = served
            pending = {e for e in pending if e[:2] != served}
            if kind == "stop":
                self.events.append((self.t, f"stop {k}", self.word()))
                self.status = "STOPPED"
                return
            jumps, first = jumps + 1, False
            if kind == "impact":
                closes, impact = self._impact(k), None
                closing = [] if closes is None else [k]
                name = f"impact {k - self.model.m}" if closes is None else "mode"
            else:
                self.x = np.array(self.model.maps[k](*self.x.tolist(), self.t))
                name = p.jumps[k].name
            if jumps > 50:
                self.status = "ENDLESS_JUMPS"
                return
            at = closes if name == "mode" else self.t
            self.events.append((at, name, ""))
            values = self.model.guards(self.x, self.t)[self.model.m + self.model.c :]
            before, before2, zeros = side.copy(), view.copy(), set()
            for a, value in enumerate(values):
                if abs(value) > 1e-9:
                    side[a] = view[a] = int(np.sign(value))
                    turned.discard(a)
                else:
                    zeros.add(a)
            pending |= due(before, before2, served)
        self.side = side
        if jumps:
            at, name, _ = self.events[-1]
            self.events[-1] = (at, name, self.word())

    def _settle(self, active: list[int], bound: dict[int, int], moved: bool = False) -> None:
        """Choose the mode after an event at which ``active`` elements are zero, or after a jump."""
        m, values = self.model.m, self.model.guards(self.x, self.t)
        mode, active = list(self.mode), list(active)
        if moved:
            for i in range(m):
                if abs(values[i]) < 1e-10:
                    active.append(i)
                elif abs(values[i]) < _CLOSE:
                    raise Undecided("a jump leads near a surface")
                else:
                    mode[i] = int(np.sign(values[i]))
            for k in range(m + self.model.c, len(mode)):
                mode[k] = 1
                if np.linalg.norm(self.model.vector(self.x, self.t)) < _CLOSE:
                    raise Undecided("a jump leads near a set")
            for k in range(m, m + self.model.c):
                if mode[k] == 0 and (abs(values[k]) > 1e-9 or abs(self._rate(k)) > 1e-9):
                    raise Undecided("a jump out of a closed contact")
                if mode[k] == 1 and values[k] < _CLOSE and k not in active:
                    if self._rate(k) < 0 or values[k] < -_CLOSE:
                        raise Undecided("a jump into a contact")
        size = m + self.model.c
        active = sorted({*active, *[i for i in range(size) if mode[i] == 0]})
        if self.problem.hidden and active:
            found = [self._layer(tuple(mode), active, bound)]
        else:
            found = self._continuations(tuple(mode), active, bound)
        if not found and self.mode[size:] == (0,):
            raise Undecided("a set may be left with another event")
        if len(found) != 1:
            self.status = "NON_UNIQUE" if found else "INTERSECTION"
            return
        self._take(found[0], event=not moved)

    def _take(self, mode: tuple[int, ...], event: bool) -> None:
        """Go on in a mode."""
        before, self.mode, size = self.word(), mode, self.model.m + self.model.c
        self.unknown = self.model.unknowns(self.x, self.t, self.mode, self.unknown)
        room = self._room(self.x, self.t)[: 2 * size]
        self.fresh |= {r for r in range(2 * size) if abs(room[r]) < _CLOSE}
        if event and self.word() != before:
            self.events.append((self.t, "mode", self.word()))

    def _continuations(
        self, mode: tuple[int, ...], active: list[int], bound: dict[int, int]
    ) -> list[tuple[int, ...]]:
        """Modes of the active elements whose rates and unknowns agree with them."""
        found, m, size = [], self.model.m, self.model.m + self.model.c
        letters = [
            (0, bound[i])
            if i in bound and i < m
            else (1, -1, 0)[: 3 - (self.model.own <= i)]
            if i < m
            else (0, 1)
            for i in active
        ]
        for chosen in product(*letters):
            candidate = list(mode)
            for i, letter in zip(active, chosen, strict=True):
                candidate[i] = letter
            unknown = self.model.unknowns(
                self.x, self.t, tuple(candidate), np.zeros(len(self.unknown))
            )
            rates = self.model.rates(self.x, self.t, unknown)
            room = []
            for i, letter in zip(active, chosen, strict=True):
                if i in bound and all(candidate[j] == mode[j] for j in active if j != i):
                    room.append(
                        1.0 if letter else -1.0
                    )  # its unknown is at the bound and leaves it
                elif letter == 0:
                    room.append(1 - abs(unknown[i]) if i < m else unknown[i])
                else:
                    room.append(letter * rates[i])
            if mode[size:] == (0,):
                room.append(1 - float(np.linalg.norm(unknown[size:])))
            growth = self._growth(self.x, self.t, tuple(candidate), unknown)
            if min(room, default=1.0) > -_CLOSE and growth < _CLOSE:
                if min(room, default=1.0) < _CLOSE or growth > -_CLOSE:
                    raise Undecided("a rate is nearly zero")
                found.append(tuple(candidate))
        return found

    def _meet_set(self) -> None:
        """The set is reached or left: rest on it, or the one direction in which it is left."""
        model, size = self.model, self.model.m + self.model.c
        row, off, on = 2 * size + len(self.side), self.mode, (*self.mode[:-1], 0)
        guess = self.unknown.copy()
        if self.mode[-1]:  # what is left of the way to the set
            self.x = self.x - np.linalg.pinv(self._set_slope()) @ model.vector(self.x, self.t)
            unknown = model.unknowns(self.x, self.t, on, guess)
            room = 1 - np.linalg.norm(unknown[size:])
            if abs(room) < _CLOSE:
                raise Undecided("friction of a set is nearly at its bound")
            if room > 0:
                self._take(on, event=True)
                return
        off = (*self.mode[:-1], 1)
        gradient = self._set_slope()

        def rate(angle: float) -> tuple[float, float]:
            """Rates of the set's function across and along a direction."""
            e = np.array([math.cos(angle), math.sin(angle)])
            x = self.x + np.linalg.pinv(gradient) @ (_REACHED * e)
            h = model.rates(x, self.t, model.unknowns(x, self.t, off, guess))[size:]
            return float(e[0] * h[1] - e[1] * h[0]), float(e @ h)

        grid = np.linspace(0, 2 * math.pi, 181)
        across, found = [rate(a)[0] for a in grid], []
        for k in range(180):
            if across[k] * across[k + 1] < 0:
                angle = brentq(lambda a: rate(a)[0], grid[k], grid[k + 1], xtol=1e-14)
                if rate(angle)[1] > -_CLOSE:
                    found.append(angle)
        if len(found) != 1 or rate(found[0])[1] < _CLOSE:
            raise Undecided("directions from a set")
        e = np.array([math.cos(found[0]), math.sin(found[0])])
        self.x = self.x + np.linalg.pinv(gradient) @ (_REACHED * e)
        self.fresh.add(row)
        self._take(off, event=True)

    def _set_slope(self) -> np.ndarray:
        return self.model.gradients(self.x, self.t)[0][self.model.m + self.model.c :]

    def _layer(
        self, mode: tuple[int, ...], active: list[int], bound: dict[int, int]
    ) -> tuple[int, ...]:
        """Follow the one multiplier through its layer to a rest or to a side."""
        if len(active) > 1 or len(mode) > 1:
            raise Undecided("a hidden law beside other elements")
        gradient, by_time = self.model.gradients(self.x, self.t)

        def rate(value: float) -> float:
            f = self.model.field(self.x, self.t, np.array([value]))
            return float((gradient @ f + by_time)[0])

        begins = float(self.unknown[0]) if self.mode[0] == 0 else float(self.mode[0])
        if bound:
            return (bound[0],)
        way = math.copysign(1.0, rate(begins))
        grid = begins + way * np.linspace(0.0, 1 - way * begins, 2001)[1:]
        last = begins
        for value in grid:
            if rate(value) * way < 0:
                self.unknown[0] = brentq(rate, last, value, xtol=1e-15)
                return (0,)
            last = value
        return (int(way),)


def follow(problem: Problem) -> Outcome:
    """Run a problem."""
    try:
        return Run(problem).run()
    except Undecided as error:
        return Outcome([], np.array(problem.start), 0.0, "", str(error))


def package_system(problem: Problem, sets: bool = False) -> Any:
    """The same system for the package; with ``sets`` each surface is a set of one."""
    import casadi as ca

    import nonsmooth as ns

    space: dict[str, Any] = {name: getattr(ca, name) for name in _NAMES}
    m, c = len(problem.surfaces), len(problem.contacts)
    names = [*problem.states, "t", *[f"l{i}" for i in range(m)], *[f"r{k}" for k in range(c)]]
    names += [*problem.numbers, "u0", "u1"]
    space |= {name: ca.SX.sym(name) for name in names}

    def read(expression: str) -> Any:
        return ca.SX(eval(expression, space))

    options: dict[str, Any] = {}
    if problem.numbers:
        options["parameters"] = {space[name]: value for name, value in problem.numbers.items()}
    if problem.tables:  # found by from_expression, as are surfaces beside them
        space |= {f"l{i}": ca.sign(read(h)) for i, h in enumerate(problem.surfaces)}
        for j, table in enumerate(problem.tables):
            space[f"tab{j}"] = ns.table(read(table.argument), table.xs, table.ys, outside="linear")
    elif m:
        options["surfaces"] = [[read(h)] if sets else read(h) for h in problem.surfaces]
        options["multipliers"] = [[space[f"l{i}"]] if sets else space[f"l{i}"] for i in range(m)]
    for first, second in problem.sets:
        options.setdefault("surfaces", []).append([read(first), read(second)])
        options.setdefault("multipliers", []).append([space["u0"], space["u1"]])
    if c:
        options["impacts"] = [
            ns.Impact(read(one.gap), restitution=read(one.restitution), reaction=space[f"r{k}"], name=f"impact {k}")
            for k, one in enumerate(problem.contacts)
        ]  # fmt: skip
    if problem.stops:
        options["stops"] = [
            ns.Stop(read(g), direction=d, name=f"stop {k}")
            for k, (g, d) in enumerate(problem.stops)
        ]
    if problem.jumps:
        options["resets"] = [_reset(one, space, read) for one in problem.jumps]
    if re.search(r"\bt\b", repr(problem)):
        options["time"] = space["t"]
    if problem.hidden:
        options["hidden"] = True
    if problem.discrete:
        options["discrete"] = {space[name]: (0, 1) for name in problem.discrete}
    count = len(problem.states) - len(problem.discrete)
    states, f = [space[s] for s in problem.states[:count]], [read(f) for f in problem.field[:count]]
    if problem.tables:
        return ns.FilippovSystem.from_expression(states, f, **options)
    return ns.FilippovSystem(states, field=f, **options)


def _reset(one: Jump, space: dict[str, Any], read: Any) -> Any:
    import casadi as ca

    import nonsmooth as ns

    condition, options = read(one.guard), {"direction": one.direction}
    if one.other:
        own = condition * one.direction >= 0
        join = ca.logic_or if one.either else ca.logic_and
        condition, options = join(own, read(one.other) >= 0), {}
    if one.level:
        options["level"] = True
    if one.when:
        options["when"] = read(one.when) >= 0
    if one.priority:
        options["priority"] = one.priority
    target = {space[s]: read(e) for s, e in one.target.items()}
    return ns.Reset(condition, target, name=one.name, **options)
