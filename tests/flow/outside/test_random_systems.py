"""Random systems in two to five dimensions with one to three surfaces: itineraries, alone and in
lanes, are those of an integrator that shares no code, and errors are below a hundred times the tolerance."""

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import pytest

import nonsmooth as ns

from ..independent.family import Many, Size, draw, system, values
from ..independent.integrator import Path, Run

T_END = 4.0
SIZES = [Size(n, m) for n in (2, 3, 4, 5) for m in (1, 2, 3)]
TOLERANCES = dict(
    zip(SIZES, [1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13] * 2, strict=False)
)

#: Systems of each size, and in the short version.
COUNT, FEW = 42, 3

#: Statuses of runs that the independent integrator ends early.
EARLY = {ns.Status.INTERSECTION, ns.Status.NON_UNIQUE}


@dataclass
class Sample:
    """Systems of one size with their trajectories, by the independent integrator."""

    size: Size
    drawn: list
    paths: list[Path]


@lru_cache(maxsize=1)
def sample(size: Size, count: int) -> Sample:
    """Draw systems and follow them."""
    rng = np.random.default_rng([size.n, size.m])
    drawn = [draw(size, rng) for _ in range(count)]
    return Sample(size, drawn, Run(Many(drawn), T_END).run())


@cache
def of_size(size: Size) -> ns.FilippovSystem:
    return system(size)


def runs(found: Sample, lanes: bool, tol: float):
    """Last state, itinerary, status and, alone, event times of each system."""
    one, starts = of_size(found.size), np.array([d["x0"] for d in found.drawn])
    numbers = np.array([values(d) for d in found.drawn])
    if not lanes:
        for start, row in zip(starts, numbers, strict=True):
            given = dict(zip(one.parameter_names, row, strict=True))
            run = ns.simulate(one, start, T_END, parameters=given, tol=tol)
            yield run.x[-1], run.itinerary, run.status, [e.t for e in run.events if e.kind != "end"]
        return
    # Lanes take 64 trajectories or more; each system is there more than once then.
    copies = -(-64 // len(starts))
    starts, numbers = np.tile(starts, (copies, 1)), np.tile(numbers, (copies, 1))
    given = dict(zip(one.parameter_names, numbers.T, strict=True))
    work = ns.Work(progress=False)
    many = ns.ensemble(one, starts, T_END, parameters=given, tol=tol, work=work)
    assert many.engine == ("lanes" if found.size.m == 1 else "core")
    for k in range(len(starts)):
        yield many.x[k], many.itinerary[k], ns.Status(int(many.status[k])), None


def compare(found: Sample, lanes: bool) -> None:
    tol, decided = TOLERANCES[found.size], 0
    results = list(runs(found, lanes, tol))
    for k, (x, itinerary, status, times) in enumerate(results):
        path, label = found.paths[k % len(found.drawn)], f"system {k} of {found.size}"
        if path.trouble:
            assert status in EARLY or "close" in path.trouble or "once" in path.trouble, label
            continue
        decided += 1
        assert (itinerary, status) == (path.itinerary, ns.Status.REACHED_END), label
        assert np.all(np.abs(x - path.x) <= 100 * tol * (1 + np.abs(path.x))), label
        if times is not None:
            assert np.all(np.abs(np.array(times) - path.times) <= 100 * tol * (1 + T_END)), label
    assert decided >= 0.9 * len(results)


@pytest.mark.parametrize(
    ("size", "lanes"), [(Size(2, 1), False), (Size(3, 3), False), (Size(3, 1), True)], ids=str
)
def test_a_few_random_systems_agree_with_an_independent_integrator(size, lanes):
    compare(sample(size, FEW), lanes)


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [False, True])
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_500_random_systems_agree_with_an_independent_integrator(size, lanes):
    assert len(SIZES) * COUNT >= 500
    compare(sample(size, COUNT), lanes)
