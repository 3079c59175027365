"""Event by event: a mechanism with a few contacts and Coulomb friction, by trying all states of the contacts.

Impacts are those of Newton and Coulomb, with the restitution 0 along the contact. Steps are those of Dormand and
Prince of order 8. Approaches slower than ``SLOW``, and those of two contacts in turn ``SOON`` after one another, end
in closed contacts: results have errors of that size.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Values = Callable[..., np.ndarray]

#: A contact takes no impulse; takes one and its slip is 0; slips forward; slips backward.
OPEN, STICK, FORWARD, BACKWARD = range(4)


def impulses(
    inverse: np.ndarray,
    normal: np.ndarray,
    tangent: np.ndarray,
    v: np.ndarray,
    target: np.ndarray,
    mu: float,
) -> np.ndarray:
    """Velocities after impulses at closed contacts, from ``v`` to normal velocities of at least ``target``."""
    for states in product(range(4), repeat=len(normal)):
        rows, aims, columns = [], [], []
        for n, t, own, state in zip(normal, tangent, target, states, strict=True):
            if state == OPEN:
                continue
            slide = 0.0 if state == STICK else mu if state == BACKWARD else -mu
            rows.append(n)
            aims.append(own - n @ v)
            columns.append(inverse @ (n + slide * t))
            if state == STICK:
                rows.append(t)
                aims.append(-t @ v)
                columns.append(inverse @ t)
        after, p = v, np.zeros(0)
        if rows:
            move = np.array(columns).T
            p = np.linalg.lstsq(np.array(rows) @ move, np.array(aims), rcond=None)[0]
            after = v + move @ p
        if _fits(states, normal, tangent, after, p, target, mu):
            return after
    raise ArithmeticError("no impulses fit")


def _fits(
    states: Sequence[int],
    normal: np.ndarray,
    tangent: np.ndarray,
    after: np.ndarray,
    p: np.ndarray,
    target: np.ndarray,
    mu: float,
) -> bool:
    at, small = 0, 1e-9 * (1 + float(np.abs(after).max()))
    for n, t, own, state in zip(normal, tangent, target, states, strict=True):
        if n @ after < own - small:
            return False
        if state == OPEN:
            continue
        if p[at] < 0:
            return False
        if state == STICK and (abs(p[at + 1]) > mu * p[at] or abs(t @ after) > small):
            return False
        if state in (FORWARD, BACKWARD) and (t @ after) * (1 if state == FORWARD else -1) < -small:
            return False
        at += 2 if state == STICK else 1
    return True


SLOW, SOON, SMALL, TOUCH = 1e-5, 1e-8, 1e-9, 1e-9
SIGN = {FORWARD: 1.0, BACKWARD: -1.0}


@dataclass
class Mechanism:
    """Functions of positions and velocities: mass matrix, force, gaps; gradients of gaps and slips; ``bias``:
    accelerations of gaps, then of slips, by the velocities alone."""

    mass: Values
    force: Values
    gaps: Values
    normals: Values
    tangents: Values
    bias: Values
    restitution: Sequence[float]
    friction: float

    def solve(
        self, q: np.ndarray, v: np.ndarray, mode: tuple[int, ...]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Accelerations, normal forces and friction forces of a mode."""
        n, inverse = len(mode), np.linalg.inv(self.mass(q))
        normal, tangent, bias = self.normals(q), self.tangents(q), self.bias(q, v)
        rows, aims, columns, names = [], [], [], []
        free = inverse @ self.force(q, v)
        for i, state in enumerate(mode):
            if state == OPEN:
                continue
            rows.append(normal[i])
            aims.append(-bias[i] - normal[i] @ free)
            columns.append(
                inverse @ (normal[i] - self.friction * SIGN.get(state, 0.0) * tangent[i])
            )
            names.append((i, 0))
            if state == STICK:
                rows.append(tangent[i])
                aims.append(-bias[n + i] - tangent[i] @ free)
                columns.append(inverse @ tangent[i])
                names.append((i, 1))
        force = np.zeros((n, 2))
        if rows:
            move = np.array(columns).T
            found = np.linalg.lstsq(np.array(rows) @ move, np.array(aims), rcond=None)[0]
            free = free + move @ found
            for (i, kind), value in zip(names, found, strict=True):
                force[i, kind] = value
        return free, force[:, 0], force[:, 1]

    def fits(
        self, q: np.ndarray, v: np.ndarray, mode: tuple[int, ...], touching: np.ndarray
    ) -> bool:
        """Whether a mode of the touching contacts continues from here."""
        n, mu = len(mode), self.friction
        a, reaction, friction = self.solve(q, v, mode)
        gap = self.normals(q) @ a + self.bias(q, v)[:n]
        slip, change = self.tangents(q) @ v, self.tangents(q) @ a + self.bias(q, v)[n:]
        for i, state in enumerate(mode):
            size = SMALL * (1 + abs(gap[i]) + abs(reaction[i]))
            if state == OPEN:
                if touching[i] and gap[i] < -size:
                    return False
                continue
            if reaction[i] < -size:
                return False
            if state == STICK:
                if mu and (abs(slip[i]) > SMALL or abs(friction[i]) > mu * reaction[i]):
                    return False
            elif mu and abs(slip[i]) > SMALL and SIGN[state] * slip[i] < 0:
                return False
            elif (
                mu
                and abs(slip[i]) <= SMALL
                and SIGN[state] * change[i] < -SMALL * (1 + abs(change).max())
            ):
                return False
        return True

    def choose(self, q: np.ndarray, v: np.ndarray, touching: np.ndarray) -> tuple[int, ...]:
        closed = (FORWARD, BACKWARD, STICK, OPEN) if self.friction else (FORWARD, OPEN)
        for mode in product(*[closed if one else (OPEN,) for one in touching]):
            if self.fits(q, v, mode, touching):
                return mode
        raise ArithmeticError("no mode fits")


def _events(body: Mechanism, n: int, mode: tuple[int, ...]) -> list[Any]:
    """Guards of a mode: gaps, reactions, slips and what sticking leaves."""

    def guard(i: int, kind: str) -> Any:
        def value(_t: float, x: np.ndarray) -> float:
            q, v = x[:n], x[n:]
            if kind == "gap":
                return float(body.gaps(q)[i])
            if kind == "slip":
                return float(SIGN[mode[i]] * (body.tangents(q)[i] @ v))
            _, reaction, friction = body.solve(q, v, mode)
            return float(
                reaction[i] - (abs(friction[i]) / body.friction if kind == "stick" else 0.0)
            )

        value.terminal, value.direction = True, -1  # type: ignore[attr-defined]
        value.kind = kind  # type: ignore[attr-defined]
        return value

    found = []
    for i, state in enumerate(mode):
        found.append(guard(i, "gap" if state == OPEN else "reaction"))
        if state in SIGN and body.friction:
            found.append(guard(i, "slip"))
        if state == STICK and body.friction:
            found.append(guard(i, "stick"))
    return found


def _land(
    body: Mechanism, q: np.ndarray, v: np.ndarray, since: float
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities after the impacts of contacts that touch, and which of them stay closed."""
    touching = np.abs(body.gaps(q)) < TOUCH
    closed = np.flatnonzero(touching)
    if len(closed):
        normal, tangent = body.normals(q)[closed], body.tangents(q)[closed]
        rate = normal @ v
        target = -np.asarray(body.restitution)[closed] * np.minimum(rate, 0.0)
        ends = np.abs(rate).max() < SLOW or (since < SOON and len(closed) > 1)
        if ends:
            target[:] = 0.0
        if (rate < -SMALL * SLOW).any() or ends:
            v = impulses(np.linalg.inv(body.mass(q)), normal, tangent, v, target, body.friction)
        touching[closed] = np.abs(normal @ v) < SMALL
    return v, touching


def follow(
    body: Mechanism, q: np.ndarray, v: np.ndarray, t_end: float, max_step: float
) -> np.ndarray:
    """Positions and velocities at the end."""
    n, t, x, last, pace = len(q), 0.0, np.concatenate([q, v]), 0.0, max_step
    mode = body.choose(q, v, np.zeros(len(body.gaps(q)), bool))
    while t < t_end:

        def rates(_t: float, x: np.ndarray, mode: tuple[int, ...] = mode) -> np.ndarray:
            return np.concatenate([x[n:], body.solve(x[:n], x[n:], mode)[0]])

        guards = _events(body, n, mode)
        until = min(t_end, t + 10 * pace)  # events come in quick succession where they did before
        run = solve_ivp(
            rates, (t, until), x, method="DOP853", rtol=1e-11, atol=1e-12, max_step=pace, events=guards
        )  # fmt: skip
        t, x = run.t[-1], run.y[:, -1]
        if run.status != 1:
            pace = min(3 * pace, max_step)
            continue
        since, last = t - last, t
        pace = min(max_step, max(0.05 * since, SOON / 10))
        v, touching = _land(body, x[:n], x[n:], since)
        if any(
            len(times) and g.kind == "reaction"
            for g, times in zip(guards, run.t_events, strict=True)
        ):
            reaction = body.solve(x[:n], x[n:], mode)[1]  # several may be released together
            touching &= reaction > SMALL * (1 + np.abs(body.force(x[:n], x[n:])).max())
        held = body.normals(x[:n])[touching]
        q = x[:n] - np.linalg.pinv(held) @ body.gaps(x[:n])[touching] if len(held) else x[:n]
        x = np.concatenate([q, v])
        mode = body.choose(x[:n], v, touching)
    return x
