"""Attractors by returns: closed forms, any section, and what is no attractor."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.orbit.periodic_cases import values_of, weakening_friction

x, v, t = (ca.SX.sym(s) for s in ("x", "v", "t"))
QUIET = ns.Work(threads=1, progress=False)
AXIS = np.linspace(-1.9, 2.1, 5)
GRID = {"x": AXIS, "v": AXIS}
KICKED = values_of("cases/orbits_2.json")["BA1"]


def kicked():
    kick = ns.Reset(x, [x, v + 0.3], direction=1, name="kick")
    return ns.FilippovSystem([x, v], field=[v, -x - 0.1 * v], resets=kick)


def van_der_pol():
    return ns.FilippovSystem([x, v], field=[v, (1 - x * x) * v - x])


def belt():
    return weakening_friction(x, v)


def logistic(r):
    return ns.FilippovSystem([x], field=[0.0 * x], clocks=ns.Clock(1.0, map=[r * x * (1 - x)]))


SLOW = pytest.mark.slow


@pytest.mark.parametrize("near", [pytest.param(0.01, marks=SLOW), 0.05])
@pytest.mark.parametrize("section", ["kick", pytest.param(x, marks=SLOW), ns.Section(v, -1), None])
def test_kicked_oscillator_has_one_attractor(section, near):
    """BA1: the return map is v -> k (v + .3)."""
    for t_end in (300.0, 1000.0):
        found = ns.basins(kicked(), GRID, t_end, section=section, near=near, work=QUIET)
        assert found.fractions == {1: 1.0} and len(found.attractors) == 1
        (one,) = found.attractors
        if section is None:
            assert one.kind == "recurrent"
            continue
        assert one.kind == "cycle"
        assert abs(one.period - float(KICKED["period"])) < 1e-11
        assert abs(one.multipliers[1] - float(KICKED["k"])) < 1e-11
        if section == "kick":
            assert abs(one.points[0, 1] - float(KICKED["v before the kick"])) < 1e-9


@pytest.mark.parametrize(
    ("build", "section", "t_end", "period"),
    [(van_der_pol, s, 100.0, 6.663286859) for s in (v, ns.Section(v, -1), x, x - v - 0.3)]
    + [(belt, s, 60.0, 8.133713023) for s in ("h0", x)]
    + [pytest.param(belt, s, 60.0, 8.133713023, marks=SLOW) for s in ("entry", "exit")],
)
def test_any_section_finds_the_one_cycle(build, section, t_end, period):
    (one,) = ns.attractors(build(), GRID, t_end, section=section, work=QUIET)
    assert one.kind == "cycle" and abs(one.period - period) < 1e-8


@pytest.mark.parametrize(
    ("r", "p"), [pytest.param(2.9, 1, marks=SLOW), (3.2, 2), (3.5, 4), (3.83, 3)]
)
def test_cycles_of_the_logistic_map(r, p):
    starts = np.stack([np.linspace(0.013, 0.987, 12), np.zeros(12)], axis=-1)
    (one,) = ns.attractors(logistic(r), starts, 512.0, section="clock", work=QUIET)
    assert one.kind == "cycle" and len(one.points) == p and abs(one.period - p) < 1e-12
    values = one.points[:, 0]
    assert np.abs(np.roll(r * values * (1 - values), 1) - values).max() < 1e-9
    slope = float(np.prod(r * (1 - 2 * values)))
    if len(one.multipliers):
        assert min(np.abs(one.multipliers - slope)) < 1e-7 * max(1.0, abs(slope))


def test_every_second_return_of_a_doubled_cycle_are_two():
    starts = np.stack([np.linspace(0.013, 0.987, 12), np.zeros(12)], axis=-1)
    second = ns.Section("clock", every=2)
    found = ns.attractors(logistic(3.2), starts, 512.0, section=second, work=QUIET)
    values = sorted(float(a.points[0, 0]) for a in found)
    root = math.sqrt((3.2 - 3) * (3.2 + 1))
    assert np.allclose(values, [(4.2 - root) / 6.4, (4.2 + root) / 6.4], atol=1e-9)
    assert all(len(a.points) == 1 and abs(a.period - 2) < 1e-12 for a in found)


def test_forced_cycles_have_no_multiples():
    """Duffing's oscillator: one orbit of the forcing's period in each well, none of twice that."""
    duffing = ns.FilippovSystem([x, v], field=[v, -0.15 * v + x - x**3 + 0.2 * ca.cos(t)], time=t)
    found = ns.attractors(duffing, GRID, 600 * math.pi, section=2 * math.pi, work=QUIET)
    assert [len(a.points) for a in found] == [1, 1]
    assert all(abs(a.period - 2 * math.pi) < 1e-12 for a in found)
    assert found[0].points[0, 0] * found[1].points[0, 0] < 0


@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_two_close_cycles_in_any_unit_with_starts_on_the_section(unit):
    """r' = -200 r (r - 1)(r - 1.05)(r - 1.1): starts beside the unstable cycle go to either side."""
    r = ca.sqrt(x * x + v * v) / unit
    rate = -200 * (r - 1) * (r - 1.05) * (r - 1.1)
    system = ns.FilippovSystem([x, v], field=[x * rate - v, v * rate + x])
    radii = np.array([0.9, 0.99, 1.04, 1.06, 1.12, 1.3])
    starts = np.stack([radii * unit, np.zeros(6)], axis=-1)
    found = ns.basins(system, starts, 60.0, section=ns.Section(v, 1), work=QUIET)
    values = [float(a.points[0, 0]) / unit for a in found.attractors]
    assert np.allclose(sorted(values), [1.0, 1.1], atol=1e-9)
    assert np.allclose(np.array(values)[found.labels - 1], [1, 1, 1, 1.1, 1.1, 1.1], atol=1e-9)


@pytest.mark.parametrize("section", [None, "h0"])
def test_rest_on_a_set_and_infinity(section):
    """Dry friction of force 1 beside a spring, with damping and without any at high speed."""
    dry = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.2], below=[v, -x + 0.2])
    found = ns.basins(dry, GRID, 100.0, section=section, work=QUIET)
    assert found.fractions == {1: 1.0} and [a.kind for a in found.attractors] == ["rest"]
    assert np.abs(found.attractors[0].points[:, 0]).max() <= 0.2 + 1e-9
    anti = ns.FilippovSystem(
        [x, v], surface=v, above=[v, -x + 0.1 * v - 1], below=[v, -x + 0.1 * v + 1]
    )
    axis = np.linspace(-30, 30, 7)
    found = ns.basins(anti, {"x": axis, "v": axis}, 200.0, section=section, work=QUIET)
    (inside,) = np.unique(found.labels[3, 3])
    assert set(np.unique(found.labels)) == {-5, inside} and found.name(-5) == "to infinity"
    assert found.attractors[inside - 1].kind == "rest"


@pytest.mark.parametrize("section", [None, v, "h0"])
def test_a_point_and_a_cycle_that_never_meets_the_section(section):
    r2 = x**2 + v**2
    system = ns.FilippovSystem(
        [x, v],
        surface=r2 - 1,
        above=[x * (4 - r2) - 5 * v, v * (4 - r2) + 5 * x],
        below=[-x - v, x - v],
    )
    axis = np.linspace(-3, 3, 12)
    found = ns.basins(system, {"x": axis, "v": axis}, 40.0, section=section, work=QUIET)
    inside = axis[:, None] ** 2 + axis**2 < 1
    rest = int(found.labels[6, 6])
    assert found.fractions[rest] == inside.mean()
    assert np.array_equal(found.labels == rest, inside) and set(np.unique(found.labels)) == {1, 2}
    assert found.attractors[rest - 1].kind == "point"
    assert np.abs(found.attractors[rest - 1].points).max() < 1e-9
    other = found.attractors[2 - rest]
    assert other.kind == ("cycle" if section is v else "recurrent")
    assert np.abs(np.hypot(*other.points.T) - 2.0).max() < 1e-6
    assert section is v or len(other.points) > 5


@pytest.mark.parametrize("section", [None, pytest.param(v, marks=SLOW)])
def test_a_centre_has_no_attractor(section):
    centre = ns.FilippovSystem([x, v], field=[v, -x])
    found = ns.basins(centre, GRID, 100.0, section=section, work=QUIET)
    assert not found.attractors and set(np.unique(found.labels)) == {0}


def test_kinds_survive_a_file(tmp_path):
    found = ns.basins(kicked(), GRID, 300.0, section="kick", work=QUIET)
    found.save(tmp_path / "basins.npz")
    (again,) = ns.load(tmp_path / "basins.npz").attractors
    (one,) = found.attractors
    assert (again.kind, again.period) == (one.kind, one.period)
    assert np.array_equal(again.multipliers, one.multipliers) and "cycle of period 6.29" in repr(
        again
    )


@pytest.mark.parametrize("every", [1, 2, 6])
def test_two_cycles_on_a_line_where_a_state_is_zero(every):
    """r' = -k (r - 1) (r - 1.05) (r - 1.1), from and with returns to v = 0."""
    r = ca.sqrt(x**2 + v**2)
    rate = -200 * (r - 1) * (r - 1.05) * (r - 1.1)
    system = ns.FilippovSystem([x, v], field=[rate * x - v, rate * v + x])
    section = ns.Section(v, 1, every=every)
    starts = {"x": [0.8, 0.9, 1.04, 1.06, 1.2, 1.5], "v": 0.0}
    found = ns.basins(system, starts, 500.0, section=section, work=QUIET)
    inner, outer = found.labels[[0, -1]]
    assert found.labels.tolist() == 3 * [inner] + 3 * [outer] and {inner, outer} == {1, 2}
    for label, radius in ((inner, 1.0), (outer, 1.1)):
        one = found.attractors[label - 1]
        factor = math.exp(-200 * radius * 0.05 * 0.1 * 2 * math.pi * every)
        assert one.kind == "cycle" and abs(one.period - 2 * math.pi * every) < 1e-9
        assert np.abs(one.points - [radius, 0.0]).max() < 1e-9
        assert abs(one.multipliers[1] - factor) < 1e-6


@pytest.mark.slow
def test_a_slow_focus_is_no_cycle():
    focus = ns.FilippovSystem([x, v], field=[v, -x - 0.002 * v])
    starts = {"x": np.linspace(-1, 1, 4), "v": 0.5}
    found = ns.basins(focus, starts, 20000.0, section=ns.Section(v, 1), work=QUIET)
    assert found.fractions == {1: 1.0} and [a.kind for a in found.attractors] == ["point"]
