"""Branches that begin at events have the orbits of closed forms, and end at those events again."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.branches.homoclinic_curves import event_of
from tests.orbit.branches import test_soft_switches as soft
from tests.orbit.periodic_cases import kinds, symbols, values_of

VALUES = values_of("cases/continuous_switching.json")
x, y, z, v, w, e, q, mu, l1, l2 = symbols("x y z v w e q mu l1 l2")


def two_zones(trace):
    """A focus with the trace 0.5 where x > 0 and one of another trace where x < 0."""
    sides = [[a * x - y, x - mu] for a in (0.5, trace)]
    return ns.FilippovSystem(
        [x, y], surface=x, above=sides[0], below=sides[1], parameters={mu: 1.0}
    )


def with_dampers(trace):
    """The same in the position and its speed: the force of a damper jumps where the speed is not zero."""
    sides = [[y, a * y - x + mu] for a in (0.5, trace)]
    return ns.FilippovSystem(
        [x, y], surface=x, above=sides[0], below=sides[1], parameters={mu: 1.0}
    )


@pytest.mark.parametrize(
    ("system", "name", "trace"),
    [
        (two_zones, "focus_focus_0", -1.0),
        (two_zones, "focus_focus_3", -0.501),
        (with_dampers, "focus_focus_0", -1.0),
    ],
)
def test_cycles_from_a_boundary_equilibrium(system, name, trace):
    rest = [1.0, 0.5 if system is two_zones else 0.0]
    passed = ns.continue_equilibrium(system(trace), rest, "mu", bounds=(-1, 1))
    (born,) = passed.events
    assert born.kind == "boundary equilibrium" and "persistence" in born.far_side.verdict
    assert [one.status for one in passed.at(-1.0)] == ["real"]
    branch = ns.continue_orbit(born, "mu", bounds=(-1, 1))
    assert kinds(branch) == ["boundary equilibrium"] and abs(branch.events[0].parameter) < 1e-12
    (orbit,) = branch.at(0.5)
    assert orbit.period == pytest.approx(float(VALUES[name]["period"]), rel=1e-10)
    assert orbit.multipliers[1] == pytest.approx(float(VALUES[name]["multiplier"]), rel=1e-8)
    up = 2 if system is two_zones else -2  # y = trace x - x'
    heights = sorted(up * leg.start[1] for leg in orbit.legs)
    expected = [float(VALUES[name][key]) for key in ("y_in_over_mu", "y_out_over_mu")]
    assert heights == pytest.approx(expected, rel=1e-8)


def test_unstable_cycles_from_a_boundary_equilibrium():
    """The same with time reversed: x and t change their signs."""
    sides = [[-a * x + y, -x + mu] for a in (0.5, -1.0)]
    back = ns.FilippovSystem(
        [x, y], surface=x, above=sides[0], below=sides[1], parameters={mu: 1.0}
    )
    born = ns.continue_equilibrium(back, [1.0, 0.5], "mu", bounds=(-1, 1)).events[0]
    (orbit,) = ns.continue_orbit(born, "mu", bounds=(-1, 1)).at(0.5)
    multiplier = 1 / float(VALUES["focus_focus_0"]["multiplier"])
    assert orbit.multipliers[1] == pytest.approx(multiplier, rel=1e-8)


def test_cycles_from_a_two_fold():
    true = VALUES["t_singularity_0.1"]
    system = ns.FilippovSystem(
        [x, y, z],
        surface=z,
        above=[-1 + 0.3 * x - 0.2 * y + 0.1 * z, -1 + 0.4 * x + 0.5 * y - 0.3 * z, y],
        below=[1 - 0.1 * x + 0.6 * y + 0.2 * z, 1 + q + 0.7 * x - 0.4 * y + 0.5 * z, x],
        parameters={q: -0.01},
    )
    start = ns.find_pseudo_equilibrium(system, [0, 0, 0]).point
    passed = ns.continue_equilibrium(system, start, "q", bounds=(-0.1, 0.1), side=None)
    assert kinds(passed) == ["two-fold"]
    branch = ns.continue_orbit(passed.events[0], "q", bounds=(-0.02, 0.02))
    (orbit,) = branch.at(float(true["q"]))
    found = np.sort([leg.duration for leg in orbit.legs])
    expected = [float(true["duration_plus"]), float(true["duration_minus"])]
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    multipliers = np.sort([float(text) for text in true["multipliers"]])
    np.testing.assert_allclose(np.sort(orbit.multipliers.real), multipliers, rtol=1e-9)
    back = ns.continue_orbit(orbit, "q", bounds=(-0.02, 0.02))
    assert kinds(back) == ["cycle from a two-fold"] and abs(back.events[0].parameter) < 1e-12
    assert all(isinstance(one.stability, str) for one in back.orbits)


def zones():
    """A centre within |x| < 1 at e = 0, outside of it a stable focus."""
    push = (e + 1) * ((x - 1) * (1 + l1) / 2 + (x + 1) * (1 - l2) / 2)
    field, given = [e * x - y - push, x], {"multipliers": [l1, l2], "parameters": {e: 0.1}}
    return ns.FilippovSystem([x, y], field=field, surfaces=[x - 1, x + 1], **given)


def chua():
    a = ca.SX.sym("e")
    h = -5 / 7 * x - 3 / 14 * ((x + 1) * l1 - (x - 1) * l2)
    field, given = [a * (y - x - h), x - y + z, -100 / 7 * y], {"parameters": {a: 6.8}}
    return ns.FilippovSystem(
        [x, y, z], field=field, surfaces=[x + 1, x - 1], multipliers=[l1, l2], **given
    )


@pytest.mark.parametrize(
    ("system", "start", "bounds", "born", "value", "name"),
    [
        (zones, [1.2, 0.0], (-0.05, 0.12), 0.0, 0.01, "planar_fclc_1e-2"),
        pytest.param(
            *(chua, [1, -0.18338887, -0.56879784], (6.7, 6.9), 6.79766049863938, 6.8, "chua_6.8"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_cycles_from_a_centre(system, start, bounds, born, value, name):
    system = system()
    orbit = ns.periodic_orbit(system, ns.simulate(system, start, 150.0))
    branch = ns.continue_orbit(orbit, "e", bounds=bounds)
    assert kinds(branch) == ["focus-centre-limit cycle"]
    assert branch.events[0].parameter == pytest.approx(born, abs=1e-11)
    again = ns.continue_orbit(branch.events[0], "e", bounds=bounds)
    (found,) = again.at(value)
    assert {value, again.values.max()} <= {*branch.values, value, bounds[1]}
    true = VALUES[name].get("multipliers") or ["1", VALUES[name]["multiplier"]]
    expected = np.sort([float(text) for text in true])
    np.testing.assert_allclose(np.sort(found.multipliers.real), expected, rtol=1e-7)


def test_periods_diverge_at_the_boundary_nodes_of_a_neuron():
    """Three zones: nodes outside, at v = 1/8 for I = 3/8 and at v = 5/8 for I = 7/8."""
    drive = ca.SX.sym("I")
    push = (2 * v - 0.25) * (1 + l1) / 2 - (2 * v - 1.25) * (1 + l2) / 2
    neuron = ns.FilippovSystem(
        [v, w],
        field=[-v + drive + push - w, 0.05 * (v - 0.5 * w)],
        surfaces=[v - 0.125, v - 0.625],
        multipliers=[l1, l2],
        parameters={drive: 0.6},
    )
    orbit = ns.periodic_orbit(neuron, [0.625, 0.9822698004037512])
    assert orbit.floquet.logarithms[0].real == pytest.approx(np.log(4.952947755031515976e-21), 1e-9)
    assert orbit.stability == "strongly stable"
    branch = ns.continue_orbit(orbit, "I", bounds=(0.1, 1.0))
    assert kinds(branch) == ["infinite period at a boundary node"] * 2
    assert [one.parameter for one in branch.events] == pytest.approx([0.375, 0.875], abs=1e-12)
    assert branch.ends == (ns.orbit.BranchEnd.PERIOD_DIVERGES,) * 2


@pytest.mark.parametrize(("beyond", "multiplier"), [(1e-3, -46.67), (1e-5, -4598.22)])
def test_visits_beyond_a_force_that_jumps(beyond, multiplier):
    orbit = ns.periodic_orbit(soft.stop(5 * (soft.x - 1) + 0.2), [0, 0])
    touch = ns.continue_orbit(orbit, "A", bounds=(0.2, 0.4)).events[0]
    assert touch.kind == "grazing of a jumping force" and "persistence" in touch.far_side.verdict
    assert touch.coefficients["psi"] == pytest.approx(0.252461, abs=1e-6)
    root = beyond / touch.coefficients["psi"]  # of the depth: the free orbit would reach 1 + beyond
    predicted = -touch.coefficients["n.A.e"] / (2 * root)
    (orbit,) = ns.continue_orbit(touch, "A", bounds=(0.3, 0.4)).at(touch.parameter * (1 + beyond))
    assert orbit.itinerary == "- +" and orbit.multipliers[0].real == pytest.approx(multiplier, 2e-4)
    assert predicted == pytest.approx(multiplier, 15 * beyond + 2e-4)


@pytest.mark.slow
def test_cycles_from_a_homoclinic_orbit():
    """Van der Pol and Duffing, y' = x - x^3 + (c + x^2) y / 20: cycles around both loops of the saddle, up to a fold."""
    c = ca.SX.sym("c")
    field = [y, x - x**3 + 0.05 * (c + x**2) * y]
    duffing = ns.FilippovSystem([x, y], field=field, parameters={c: -0.82})
    loop = ns.find_homoclinic(duffing, [0.0, 0.0], "c")
    branch = ns.continue_orbit(event_of(loop), "c", bounds=(-1.2, -0.7))
    assert sorted(kinds(branch)) == ["fold", "homoclinic"]  # none beyond the loop, of several turns
    assert min(branch.values[branch.values > loop.value] - loop.value) < 5e-4
    assert next(e for e in branch.events if e.kind == "homoclinic").parameter == pytest.approx(
        loop.value, abs=1e-12
    )
