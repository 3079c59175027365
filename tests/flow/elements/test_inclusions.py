"""The law of elements: widths of layers, many contacts, and all motions of a body from rest."""

import itertools
import math
import pickle
import warnings

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from testset.problem import Problem


def ring(widths=None, unit=1):
    """Two surfaces on which sliding is stable for some ratios of the widths of their layers."""
    x, y, z, l1, l2 = (ca.SX.sym(name) for name in ("x", "y", "z", "l1", "l2"))
    field = [0.1 - (l1 + 2 * l2), 0.05 - (-2 * l1 - 0.5 * l2), l1]
    return ns.FilippovSystem(
        [x, y, z], field=field, surfaces=[x, unit * y], multipliers=[l1, l2], layer_widths=widths
    )


@pytest.mark.parametrize(
    ("widths", "unit", "stable"),
    [((1.0, 0.6), 1, True), ((1.0, 0.4), 1, False), (None, 1.9, True), (None, 2.1, False)],
)
def test_widths_of_layers_decide_where_stability_depends_on_them(widths, unit, stable):
    """The trace of the layer is 1/e1 - unit/(2 e2)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = ns.simulate(ring(widths, unit), [0, 0, 0], 1.0)
    assert run.facts.depends_on_widths
    assert run.status is (ns.Status.REACHED_END if stable else ns.Status.INTERSECTION)


def test_widths_are_part_of_a_system():
    system = ring((1.0, 0.6))
    assert pickle.loads(pickle.dumps(system)).layer_widths == (1.0, 0.6)
    assert system != ring()
    assert ring((2.0, 2.0)) == ring()
    with pytest.raises(ns.DefinitionError, match="layer_widths"):
        ring((1.0,))
    with pytest.raises(ns.DefinitionError, match="layer_widths"):
        ring((1.0, -1.0))


@pytest.mark.parametrize("count", [24, 60])
def test_many_balls_land_and_are_let_go_together(count):
    """They fall with z - 2, land at one instant, and leave when z passes 2."""
    heights = [ca.SX.sym(f"h{i}") for i in range(count)]
    speeds = [ca.SX.sym(f"k{i}") for i in range(count)]
    z = ca.SX.sym("z")
    system = ns.FilippovSystem(
        [*heights, *speeds, z],
        field=[*speeds, *[z - 2.0] * count, 1],
        impacts=[ns.Impact(h, name=f"ball{i}") for i, h in enumerate(heights)],
    )
    run = ns.simulate(system, [0.1] * count + [0] * (count + 1), 4.0)
    assert run.status is ns.Status.REACHED_END
    assert [event.kind for event in run.events] == ["impact", "release", "end"]
    assert abs(run.x[-1, :count] - 4 / 3).max() < 1e-10


def test_a_bar_lands_on_many_feet():
    """Fourteen reactions of which two are independent; a plastic impact stops the bar whole or tilted."""
    y, tilt, v, w = (ca.SX.sym(name) for name in ("y", "tilt", "v", "w"))
    feet = np.linspace(-1, 1, 14)
    reactions = [ca.SX.sym(f"r{i}") for i in range(14)]
    turn = 3 * sum(p * r for p, r in zip(feet, reactions, strict=True))
    system = ns.FilippovSystem(
        [y, tilt, v, w],
        field=[v, w, sum(reactions) - 9.81, turn],
        impacts=[
            ns.Impact(y + p * tilt, reaction=r, restitution=0.0, name=f"foot{i}")
            for i, (p, r) in enumerate(zip(feet, reactions, strict=True))
        ],
    )
    for start in ([1.0, 0.0, 0.0, 0.0], [1.0, 0.1, 0.0, 0.0]):
        run = ns.simulate(system, start, 2.0)
        assert run.status is ns.Status.REACHED_END, run.message
        assert abs(run.x[-1]).max() < 1e-12
        assert run.segments[-1].mode == "c" * 14


def motions_of(body):
    """Accelerations of a planar body by all letters: open, slip to either side, stick."""
    weight, load = np.diag([1, 1, 1 / body["inertia"]]), np.array(body["load"])
    mu, rows = body["mu"], []
    for (px, py), angle in zip(body["points"], body["normal_angles"], strict=True):
        n, s = (np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))
        rows.append([np.array([*d, px * d[1] - py * d[0]]) for d in (n, s)])
    found: list[np.ndarray] = []
    for letters in itertools.product("o+-s", repeat=len(rows)):
        kept, forces, acting = [], [], []
        for letter, (n, s) in zip(letters, rows, strict=True):
            if letter == "s":
                kept, forces = [*kept, n, s], [*forces, n, -s]
            elif letter != "o":
                kept, forces = [*kept, n], [*forces, n - mu * s * (1 if letter == "+" else -1)]
            acting.append(len(forces))
        rates, size = weight @ load, np.zeros(len(forces))
        if forces:
            matrix = np.array(kept) @ weight @ np.array(forces).T
            size = np.linalg.lstsq(matrix, -np.array(kept) @ rates, rcond=1e-12)[0]
            if abs(matrix @ size + np.array(kept) @ rates).max() > 1e-9:
                continue
            rates = rates + weight @ np.array(forces).T @ size
        holds = True
        for letter, last, (n, s) in zip(letters, acting, rows, strict=True):
            if letter == "o":
                holds &= n @ rates >= -1e-9
            elif letter == "s":
                normal, tangent = size[last - 2 : last]
                holds &= normal >= -1e-9 and abs(tangent) <= mu * normal + 1e-9
            else:
                holds &= size[last - 1] >= -1e-9
                holds &= (s @ rates) * (1 if letter == "+" else -1) >= -1e-9
        if holds and not any(abs(rates - own).max() < 1e-7 for own in found):
            found.append(rates)
    return np.array(found)


def at_rest(body):
    """A planar body of unit mass that touches at points: gaps and slips are linear, so that its accelerations are those
    at rest."""
    gaps, slips, force = [], [], ["0", "0", "0"]
    total = lambda row, names: "+".join(f"({c!r})*{q}" for c, q in zip(row, names, strict=True))
    for i, ((px, py), angle) in enumerate(zip(body["points"], body["normal_angles"], strict=True)):
        n, s = (math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))
        rows = [(*d, px * d[1] - py * d[0]) for d in (n, s)]
        gaps.append(f"Impact({total(rows[0], 'xyt')}, reaction=r{i}, name='gap{i}')")
        slips.append(total(rows[1], "uvw"))
        for j in range(3):
            force[j] += f"+({rows[0][j]!r})*r{i}-({body['mu'] * rows[1][j]!r})*l{i}*r{i}"
    loads = [f"({own}+({load!r}))" for own, load in zip(force, body["load"], strict=True)]
    system = {
        "states": "[x, y, t, u, v, w]",
        "multipliers": f"[{', '.join(f'l{i}' for i in range(len(gaps)))}]",
        "surfaces": f"[{', '.join(slips)}]",
        "impacts": f"[{', '.join(gaps)}]",
        "field": f"[u, v, w, {', '.join(loads)}/{body['inertia']!r}]",
    }
    return Problem({"system": system, "start": [0] * 6, "t_end": 1e-3})


def accelerations(run):
    """Those of all motions that continue from the start, sorted."""
    if run.continuations:
        return in_order(np.array([own.rates[3:] for own in run.continuations]))
    return run.steps.coefficients[:1, 3:6, 1]


def in_order(found):
    return found[np.lexsort(found.T[::-1].round(7))]


def random_body(seed):
    rng, count = np.random.default_rng(seed), 1 + seed % 2
    return {
        "inertia": 0.3,
        "mu": float(rng.choice([0.1, 0.4, 0.8])),
        "points": rng.uniform(-0.5, 0.5, (count, 2)).round(2).tolist(),
        "normal_angles": rng.uniform(0, 6.28, count).round(2).tolist(),
        "load": (4 * rng.normal(size=3)).round(1).tolist(),
    }


#: A body with two motions.
TWO = {"inertia": 0.3, "mu": 0.8, "points": [[-0.46, 0.14], [0.42, 0.17]]}
TWO |= {"normal_angles": [6.13, 3.21], "load": [5.2, -1.4, -0.6]}


@pytest.mark.parametrize("body", [TWO, *map(random_body, range(12))], ids=range(-1, 12))
def test_accelerations_of_a_body_are_those_of_all_letters(body):
    expected = in_order(motions_of(body))
    run = at_rest(body).run()
    assert (run.status is ns.Status.NON_UNIQUE) == (len(expected) > 1), run.message
    found = accelerations(run)
    assert found.shape == expected.shape
    assert abs(found - expected).max() < 1e-7
    if body is TWO:
        known = [[0, 0, 0], [0.2933702750841114, -0.7247971502077986, 1.7257075004947573]]
        assert abs(found - known).max() < 1e-9


def test_both_lower_contacts_of_a_slider_crank_open_at_one_instant():
    """One equation for the sum of their reactions, which is zero at 0.0077, then free; by mpmath in 24 digits."""
    system = ns.textbook.slider_crank(friction=False).system
    start = [-0.2, 0.096215072118462294965, 0, 30, -14.769308200717859938, 0]
    run = ns.simulate(system, start, 0.011696271711346523, start_mode="oocc")
    assert run.status is ns.Status.REACHED_END, run.message
    end = [
        0.176814246623816172,
        -0.0912058830626747115,
        0,
        29.7569412124425986,
        -14.6168908684568787,
    ]
    assert run.x[-1, :5] == pytest.approx(end, rel=1e-8, abs=1e-8)


@pytest.mark.slow
def test_rounding_of_a_start_ends_no_run_of_a_slider_crank():
    """Rates that are zero after an impact to rounding are made zero on the gaps, not behind them."""
    problem = ns.textbook.slider_crank()
    start = problem.run(t_end=1e-9).x[0]
    for k in range(-40, 41):
        run = ns.simulate(problem.system, start * (1 + k * 2.2e-16), 0.2)
        assert run.status is ns.Status.REACHED_END, (k, run.message)
