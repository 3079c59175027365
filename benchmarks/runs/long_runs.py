"""Time of a stick-slip run to T = 1e4, with few and many events, without and with dense output."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import nonsmooth as ns

from ..bouncing.bounces import TARGET, ladder
from ..peers import heyoka_modes, scipy_dop853
from ..problems import BELTS, LETTERS, STICK_START, Array, stick_slip, stick_slip_system
from ..timing import alternate

#: The last state, and a number that two itineraries share if they are the same.
End = tuple[Array, int]
Run = Callable[[], End]
_MASK = 0x3FFFFFFFFFFFFFFF


def run(quick: bool) -> dict[str, Any]:
    """Measure both belts."""
    t_end = 100.0 if quick else 1e4
    return {name: _belt(belt, t_end, quick) | {"t_end": t_end} for name, belt in BELTS.items()}


def _belt(belt: float, t_end: float, quick: bool) -> dict[str, Any]:
    solution, other = _ours(belt, 1e-15, t_end, True)(), None
    result: dict[str, Any] = {"solvers": {}, "events": _events(belt, t_end)}
    if heyoka_modes.available():
        other = _heyoka(belt, 1e-15, t_end, False)()
        result["reference: difference to heyoka at 1e-15"] = _error(other, solution)
    work = {}
    for label, (make, tolerances) in _solvers(belt, t_end).items():
        rows = []
        for tolerance in tolerances[:: 4 if quick else 1]:
            end = make(tolerance)()
            rows.append({"tolerance": tolerance, "error": _error(end, solution)})
            rows[-1]["wrong"] = int(end[1] != solution[1])
            if rows[-1]["error"] <= TARGET and not rows[-1]["wrong"]:
                break
        result["solvers"][label] = {"rows": rows, "pick": rows[-1]}
        if rows[-1]["error"] <= TARGET:
            work[label] = make(rows[-1]["tolerance"])
        print(f"  {label}: {rows[-1]}", flush=True)
    scipy = [label for label in work if "scipy" in label]
    slow = {label: work.pop(label) for label in scipy}
    timings = alternate(work, 5 if quick else 15)
    if not quick or t_end < 1e3:
        timings |= alternate(slow, 1)
    for label, timing in timings.items():
        result["solvers"][label]["seconds"] = timing.as_dict()
    return result


def _error(end: End, solution: End) -> float:
    return float(np.abs(end[0] - solution[0]).max())


def _events(belt: float, t_end: float) -> int:
    return len(_trajectory(belt, 1e-12, t_end).segments) - 1


def _solvers(
    belt: float, t_end: float
) -> dict[str, tuple[Callable[[float], Run], tuple[float, ...]]]:
    taylor = ladder(-4, -14, 4)
    found: dict[str, tuple[Callable[[float], Run], tuple[float, ...]]] = {
        "nonsmooth": (lambda tol: _ours(belt, tol, t_end, False), taylor),
        "nonsmooth, dense": (lambda tol: _ours(belt, tol, t_end, True), taylor),
    }
    if heyoka_modes.available():
        found["heyoka"] = (lambda tol: _heyoka(belt, tol, t_end, False), taylor)
        found["heyoka, dense"] = (lambda tol: _heyoka(belt, tol, t_end, True), taylor)
    found["scipy DOP853"] = (lambda tol: _scipy(belt, tol, t_end), ladder(-9, -13, 1))
    return found


def _hash(itinerary: str) -> int:
    code = 0
    for letter in itinerary.split():
        code = (4 * code + LETTERS.index(letter) + 1) & _MASK
    return code


def _trajectory(belt: float, tolerance: float, t_end: float) -> ns.Trajectory:
    system = stick_slip_system(belt)
    return ns.simulate(system, STICK_START, t_end, tol=tolerance, max_events=10**6)


def _ours(belt: float, tolerance: float, t_end: float, dense: bool) -> Run:
    """Dense: ``simulate``. Not: ``ensemble`` of one start, which keeps the end only."""

    def solve() -> End:
        if dense:
            trajectory = _trajectory(belt, tolerance, t_end)
            return trajectory.x[-1], _hash(trajectory.itinerary)
        many = ns.ensemble(
            stick_slip_system(belt),
            [STICK_START],
            t_end,
            tol=tolerance,
            max_events=10**6,
            work=ns.Work(threads=1, progress=False),
        )
        return many.x[0], _hash(many.itinerary[0])

    return solve


def _heyoka(belt: float, tolerance: float, t_end: float, dense: bool) -> Run:
    import heyoka as hy

    engine = heyoka_modes.Heyoka(stick_slip(belt, hy.cos), tolerance)
    start = np.array([[*STICK_START, 0.0]])

    def solve() -> End:
        ends = engine.solve(start, t_end, dense)
        return ends.x[0, :2], int(ends.itinerary[0])

    return solve


def _scipy(belt: float, tolerance: float, t_end: float) -> Run:
    engine = scipy_dop853.Scipy(stick_slip(belt, math.cos), tolerance, 1e-2 * tolerance)
    start = np.array([[*STICK_START, 0.0]])

    def solve() -> End:
        ends = engine.solve(start, t_end)
        return ends.x[0, :2], int(ends.itinerary[0])

    return solve
