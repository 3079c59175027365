"""Random systems in two to five dimensions with one to three surfaces: itineraries, alone and in
lanes, are those of an integrator that shares no code, and errors are below a hundred times the tolerance."""

from functools import cache

import numpy as np
import pytest

import nonsmooth as ns

from ..independent.hybrid import Problem, follow, package_system
from ..random_systems import Text, package_events

T_END = 4.0
SIZES = [(n, m) for n in (2, 3, 4, 5) for m in (1, 2, 3)]
TOLERANCES = dict(
    zip(SIZES, [1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13] * 2, strict=False)
)

#: Systems of each size, and in the short version.
COUNT, FEW = 42, 3


def draw(n: int, m: int, rng: np.random.Generator) -> Problem:
    """A system whose text is that of its size, with numbers of its own:

    x' = A x + b + C sin(B x + c) - x |x|^2 / 20 + r / (1 + (q.x)^2) + u cos(omega t + phi)
         + sum_i lambda_i (g_i + G_i x),        h_i = w_i.x + (k_i.x)^2 / 4 + sin(v_i.x) / 4 - d_i
    """
    text, x = Text(rng), [f"x{i}" for i in range(n)]
    normals = rng.normal(size=(m, n))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    pushes = rng.uniform(0.2, 1.2) * rng.normal(size=(m, n))
    pushes -= (
        rng.uniform(-0.3, 2.5, size=(m, 1)) * normals
    )  # most surfaces attract, some are crossed

    def form(scale: float = 1.0) -> str:
        return text.form(scale * rng.normal(size=n), x)

    waves = [f"sin({form()}+{text.normal()})" for _ in x]
    peak, phase = f"/(1+({form()})**2)", f"cos({text.uniform(0.5, 3)}*t+{text.normal()})"
    size = "+".join(f"{name}*{name}" for name in x)
    field = []
    for i in range(n):
        f = f"{text.form(0.6 * rng.normal(size=n) - 0.4 * (np.arange(n) == i), x)}+{text.normal()}"
        f += f"+{text.form(rng.normal(size=n), waves)}-0.05*x{i}*({size})"
        f += f"+{text.normal()}{peak}+{text.normal()}*{phase}"
        field.append(
            f + "".join(f"+l{j}*({text.number(pushes[j, i])}+{form(0.2)})" for j in range(m))
        )
    surfaces = []
    for normal in normals:
        bent, wave = form(0.5), form(0.7)
        h = f"{text.form(normal, x)}+({bent})*({bent})/4+sin({wave})/4-{text.normal(0.4)}"
        surfaces.append(h)
    return Problem(x, field, rng.normal(size=n).tolist(), T_END, surfaces, numbers=text.numbers)


@cache
def sample(n: int, m: int, count: int) -> tuple:
    """Systems of one size as one with parameters, and their runs by the independent integrator."""
    rng = np.random.default_rng([n, m])
    drawn = [draw(n, m, rng) for _ in range(count)]
    return package_system(drawn[0]), drawn, [follow(one) for one in drawn]


def alone(system: ns.FilippovSystem, drawn: list[Problem], tol: float):
    """Last state, status, and modes and times of events of each system."""
    for one in drawn:
        run = ns.simulate(system, one.start, T_END, parameters=one.numbers, tol=tol)
        events = package_events(run, one)
        yield run.x[-1], run.status, [mode for *_, mode in events], [t for t, *_ in events]


def in_lanes(system: ns.FilippovSystem, drawn: list[Problem], tol: float):
    """The same without times. Lanes take 64 trajectories or more, so that a system is there more than once."""
    drawn = drawn * -(-64 // len(drawn))
    given = {name: [one.numbers[name] for one in drawn] for name in drawn[0].numbers}
    starts, work = [one.start for one in drawn], ns.Work(progress=False)
    many = ns.ensemble(system, starts, T_END, parameters=given, tol=tol, work=work)
    assert many.engine == "lanes"
    for x, status, word in zip(many.x, many.status, many.itinerary, strict=True):
        yield x, ns.Status(int(status)), word.split()[1:], None


def compare(size: tuple[int, int], lanes: bool, count: int) -> None:
    system, drawn, exact = sample(*size, count)
    tol, decided = TOLERANCES[size], 0
    results = list((in_lanes if lanes else alone)(system, drawn, tol))
    for k, (x, status, modes, times) in enumerate(results):
        true, label = exact[k % count], f"system {k} of {size}"
        if true.trouble:
            continue
        decided += 1
        assert (modes, status.name) == ([mode for *_, mode in true.events], true.status), label
        assert np.all(np.abs(x - true.x) <= 100 * tol * (1 + np.abs(true.x))), label
        if times is not None:
            late = np.abs(np.array(times) - [t for t, *_ in true.events])
            assert np.all(late <= 100 * tol * (1 + T_END)), label
    assert decided >= 0.9 * len(results)


@pytest.mark.parametrize(
    ("size", "lanes"), [((2, 1), False), ((3, 3), False), ((3, 1), True)], ids=str
)
def test_a_few_random_systems_agree_with_an_independent_integrator(size, lanes):
    compare(size, lanes, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [False, True])
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_500_random_systems_agree_with_an_independent_integrator(size, lanes):
    assert len(SIZES) * COUNT >= 500
    compare(size, lanes, COUNT)
