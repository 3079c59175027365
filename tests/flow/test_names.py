"""Names, elements and sides of events (``nonsmooth.flow.names``)."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v, y, w, t = (ca.SX.sym(name) for name in "xvywt")


def stick_slip(**further):
    """A block on a belt: it sticks, and slips where the spring is stronger than friction."""
    return ns.FilippovSystem([x, v], surface=v - 1, above=[v, -x - 1], below=[v, 1 - x], **further)


def events(system, start, t_end, **options):
    run = ns.simulate(system, start, t_end, **options)
    return [(e.kind, e.name, e.element, e.side) for e in run.events]


STICK_SLIP = [
    ("entry", "h0", 0, -1),
    ("exit", "lambda0 = -1", 0, -1),
    ("entry", "h0", 0, -1),
    ("exit", "lambda0 = -1", 0, -1),
]


def test_one_surface():
    assert events(stick_slip(), [0.0, 0.0], 12.0)[:4] == STICK_SLIP


@pytest.mark.parametrize("first", [True, False])
def test_two_surfaces_name_the_same_thing_alike(first):
    """A second surface that is never reached, before or after the first one."""
    lam, mu = ca.SX.sym("lam"), ca.SX.sym("mu")
    both = [(lam, v - 1), (mu, x - 50)] if first else [(mu, x - 50), (lam, v - 1)]
    system = ns.FilippovSystem(
        [x, v], field=[v, -x - lam], multipliers=[m for m, _ in both], surfaces=[h for _, h in both]
    )
    k = 0 if first else 1
    expected = [(kind, name.replace("0", str(k)), k, side) for kind, name, _, side in STICK_SLIP]
    assert events(system, [0.0, 0.0], 12.0)[:4] == expected


def test_crossings_have_the_side_from_which_the_motion_comes():
    system = ns.FilippovSystem([x, v], surface=x, above=[v, -x], below=[v, -4 * x])
    found = events(system, [0.0, 1.0], 9.0)
    assert found[:3] == [("crossing", "h0", 0, s) for s in (1, -1, 1)]
    assert found[-1] == ("end", "REACHED_END", -1, 0)


def test_stops_resets_and_clocks_have_their_number_and_direction():
    system = ns.FilippovSystem(
        [x, v],
        field=[1, 0],
        stops=[ns.Stop(x - 100), ns.Stop(x - 9, 1, "last")],
        resets=[ns.Reset(v - 7, [x, 0]), ns.Reset(x - 1, [x + 1, v], 1, "kick")],
        clocks=[ns.Clock(3.0)],
    )
    start = [0.0, 0.0, 0.0]
    assert events(system, start, 20.0) == [
        ("reset", "kick", 1, 1),
        ("reset", "clock", 2, 1),
        ("reset", "clock", 2, 1),
        ("stop", "last", 1, 1),
    ]


def test_contacts_follow_the_surfaces():
    far = ns.FilippovSystem(
        [x, v],
        surface=x - 100,
        above=[v, -1],
        below=[v, -1],
        impacts=[ns.Impact(50 - x, name="roof"), ns.Impact(x, restitution=0.5, name="floor")],
    )
    found = events(far, [1.0, 0.0], 8.0)
    assert found[:2] == [("impact", "floor", 2, 1)] * 2
    assert found[-2] == ("contact", "floor", 2, 0)


def test_release():
    system = ns.FilippovSystem(
        [x, v], field=[v, t - 1], time=t, impacts=[ns.Impact(x, name="floor")]
    )
    assert events(system, [0.0, 0.0], 2.0)[:1] == [("release", "floor", 0, 0)]


def test_sets():
    """Friction in the plane that holds until the spring pulls hard enough."""
    u = ca.SX.sym("u", 2)
    system = ns.FilippovSystem(
        [x, y, v, w],
        field=[v, w, -2 * u[0] + t, -2 * u[1]],
        time=t,
        multipliers=[u],
        surfaces=[ca.vertcat(v, w)],
    )
    found = events(system, [0.0, 0.0, -0.5, 0.3], 4.0)
    assert found[:2] == [("entry", "h0", 0, 0), ("exit", "|lambda0| = 1", 0, 0)]


@pytest.mark.parametrize("name", ["lambda1", "lambda", "lambda_", "h7", "L_F1 h", "h", "f0", "s"])
def test_odd_names_of_events_do_not_confuse(name):
    wall = ns.Reset(x + 0.3, [x, -v / 2], -1, name)
    run = ns.simulate(stick_slip(resets=[wall]), [0.0, -1.0], 4.0)
    assert ("reset", name, 0, -1) in [(e.kind, e.name, e.element, e.side) for e in run.events]
    derivative = ns.sensitivity(run).dx_dx0
    step = 1e-6
    shifted = [
        ns.simulate(stick_slip(resets=[wall]), [s, -1.0], 4.0, tol=1e-12).x[-1]
        for s in (step, -step)
    ]
    assert np.allclose((shifted[0] - shifted[1]) / (2 * step), derivative[:, 0], atol=1e-6)


@pytest.mark.parametrize("name", ["h0", "lambda0 = 1", "lambda0 = -1", "stability of sliding"])
def test_names_of_guards_are_not_left_to_other_events(name):
    system = stick_slip(stops=[ns.Stop(x - 3, name=name)])
    assert system.stops[0][0] == f"{name} 2"


def test_followed_modes_name_their_zeros_alike():
    run = ns.flow.follow(stick_slip(), [0.0, 1.0], 5.0, mode="s", until="lambda0 = -1")
    assert [(e.kind, e.name, e.element, e.side) for e in run.events] == [
        ("stop", "lambda0 = -1", 0, -1)
    ]


def test_saved_runs_keep_elements_and_sides(tmp_path):
    pytest.importorskip("pandas")
    run = ns.simulate(stick_slip(), [0.0, 0.0], 12.0)
    run.save(tmp_path / "run.npz")
    kept = ns.load(tmp_path / "run.npz")
    assert [(e.element, e.side) for e in kept.events] == [(e.element, e.side) for e in run.events]
    assert list(run.to_pandas("events")["element"]) == [e.element for e in run.events]


def test_states_and_parameters_may_be_called_like_multipliers():
    """The same run and derivative, whatever the symbols are called."""
    found = []
    for names in (("x", "v", "f", "u"), ("lambda0", "h0", "lambda1", "L_F1 h")):
        a, b, f, u = (ca.SX.sym(name) for name in names)
        system = ns.FilippovSystem(
            [a, b], surfaces=[b - 1], multipliers=[u], field=[b, -a - f * u], parameters={f: 1.0}
        )
        run = ns.simulate(system, [0.0, -0.5], 6.0)
        derivative = ns.sensitivity(run)
        kinds = [(e.kind, e.name, e.element, e.side) for e in run.events]
        found.append((run.x.tobytes(), derivative.dx_dp.tobytes(), kinds))
    assert found[0] == found[1] and found[0][2][1][:2] == ("exit", "lambda0 = -1")
