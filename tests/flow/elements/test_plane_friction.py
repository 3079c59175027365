"""Friction in the plane, by vector multipliers: states, times and itineraries of reference cases in 24 digits;
directions of slip however small; rotations and mirrors; dense output; what is refused."""

import casadi as ca
import numpy as np
import pytest
import scipy.integrate
from hypothesis import given, settings
from hypothesis import strategies as st

import nonsmooth as ns

from .. import plane_friction as plane


@pytest.mark.slow_cases("three-rolls-reference")
@pytest.mark.parametrize("name", plane.CASES)
def test_reference_cases_to_rounding(name):
    case = plane.CASES[name]
    run, begun = plane.run_of(case, 1e-13)
    assert run.status.complete
    assert run.itinerary.replace(" ", "") == case["itinerary"]
    of_state, of_times = plane.errors(case, run, begun)
    assert of_state < 1e-13
    assert of_times < 2e-13


SOME = ["oblique-roll-rotated-1", "three-rolls", "elliptical-friction"]
EVERY = [(name, tol) for name in plane.CASES for tol in (1e-6, 1e-7, 1e-9, 1e-11)]


@pytest.mark.parametrize(
    ("name", "tol"),
    [(name, tol) for name in SOME for tol in (1e-6, 1e-8, 1e-10, 1e-12)]
    + [
        pytest.param(*case, marks=pytest.mark.slow)
        for case in EVERY
        if case[0] not in SOME or case[1] < 1e-6
    ],
)
def test_errors_follow_the_tolerance(name, tol):
    case = plane.CASES[name]
    run, begun = plane.run_of(case, tol)
    assert run.itinerary.replace(" ", "") == case["itinerary"]
    assert max(plane.errors(case, run, begun)) < 100 * tol


def _ball(v, w, tol=1e-14, p=None, **options):
    p = p or {"mu": 0.3, "d1": 0.1, "d2": 0.1, "eta": 0.5, "G": 1e-4, "k": 0.4}
    start = [0.0, 0.0, *v, *w, 0.0, -1.0]
    return ns.simulate(plane.ball(**options), start, 20.0, parameters=p, tol=tol)


@pytest.mark.parametrize("angle", [0.5, 2.1, 4.0])
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_rotations_and_mirrors_do_not_matter(angle, mirror):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]]) @ np.diag([1.0, mirror])
    v, w = np.array([1.0, 0.2]), np.array([0.3, 0.5])
    one, two = _ball(v, w), _ball(turn @ v, turn @ w)
    assert one.itinerary == two.itinerary == "* s *"
    assert np.abs(np.diff([[e.t for e in run.events] for run in (one, two)], axis=0)).max() < 1e-13
    turned = np.concatenate([*[turn @ one.x[-1, i : i + 2] for i in (0, 2, 4)], one.x[-1, 6:]])
    assert np.abs(two.x[-1] - turned).max() < 4e-15


@pytest.mark.parametrize("offset", [1e-3, 1e-5, 1e-7, -1e-8])
def test_direction_of_slip_however_small(offset):
    # On a line the motion is planar: slip stays on it. Rolling ends just before lift-off, so that slip at
    # lift-off is quadratic in the offset: below 1e-17 for the smallest.
    line = np.array([np.cos(0.7), np.sin(0.7)])
    w = 0.5505198964669  # its lift-off slip is about zero
    run = _ball(0.2 * line, (0.2 + w + offset) * line, slip_as_state=True)
    h = run.x[-1, 4:6]
    assert run.itinerary == "* s *"
    assert np.linalg.norm(h) < 10 * offset**2
    assert abs(h @ [-line[1], line[0]]) < 1e-5 * np.linalg.norm(h)
    assert np.sign(h @ line) == np.sign(offset)


def test_a_sharp_turn_is_no_crossing():
    case = plane.CASES["sharp-turn-1e-9"]
    run, _ = plane.run_of(case, 1e-13)
    h = run.x[:, 2:4] + run.x[:, 4:6]
    assert run.itinerary == "*"
    assert np.linalg.norm(h, axis=1).min() < 1e-9
    slip = [float(v) for v in case["slip"]]
    assert np.abs(h[-1] - slip).max() < 1e-13


@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
def test_dense_output_to_the_tolerance(tol):
    case = plane.CASES["near-boundary-arrival"]
    run, begun = plane.run_of(case, tol)
    fine, _ = plane.run_of(case, 1e-14)
    t = np.concatenate([np.linspace(begun, 2.956, 301), 2.5913 + np.logspace(-4, -16, 25)])
    assert np.abs(run(t) - fine(t)).max() < 30 * tol


def test_several_sets_and_a_surface():
    # Two pucks of known stopping times v/mu, and an oscillator with a kick that starts one puck again.
    x = plane.columns(*"a1 a2 v1 v2 b1 b2 w1 w2 z zd".split())
    one, two = (ca.vertcat(*plane.columns(f"{n}1", f"{n}2")) for n in "lm")
    lam, mu = plane.columns("lam", "mu")
    system = ns.FilippovSystem(
        x,
        field=[
            *(x[2], x[3], -mu * one[0], -mu * one[1], x[6], x[7], -0.3 * two[0], -0.3 * two[1]),
            *(x[9], -x[8] - 0.2 * lam),
        ],
        surfaces=[ca.vertcat(x[2], x[3]), x[9], ca.vertcat(x[6], x[7])],
        multipliers=[one, lam, two],
        parameters={mu: 0.5},
        resets=[ns.Reset(x[8] + 1.0, [*x[:2], 0.3, 0.4, *x[4:]], direction=-1, name="kick")],
    )
    run = ns.simulate(system, [0, 0, 0.6, 0.8, 0, 0, 0.3, 0.4, 2.0, 0.0], 6.0, tol=1e-12)
    first, second, kick, _, last = run.events[:5]
    assert run.itinerary == "*-* *-s s-s *-s *+s s+s"
    assert [e.name for e in run.events[:5]] == ["h2", "h0", "kick", "h1", "h0"]
    assert first.t == pytest.approx(0.5 / 0.3, abs=1e-11)
    assert second.t == pytest.approx(1.0 / 0.5, abs=1e-11)
    assert kick.t == pytest.approx(np.arccos(-1.2 / 1.8), abs=1e-11)  # z = 0.2 + 1.8 cos t
    assert last.t == pytest.approx(kick.t + 1.0, abs=1e-11)
    travelled = (0.6 + 0.3 * 0.5) * np.array([1.0, 0.0]) + (0.8 + 0.4 * 0.5) * np.array([0.0, 1.0])
    assert run.x[-1, :2] == pytest.approx(travelled, abs=1e-11)


def _puck(**more):
    x, v = plane.columns("x1", "x2"), plane.columns("v1", "v2")
    lam, (mu, pull) = ca.vertcat(*plane.columns("l1", "l2")), plane.columns("mu", "pull")
    return ns.FilippovSystem(
        [*x, *v],
        field=[*v, pull - mu * lam[0], -mu * lam[1]],
        surfaces=[ca.vertcat(*v)],
        multipliers=[lam],
        parameters={mu: 0.5, pull: 0.0},
        **more,
    )


def test_a_mode_to_start_in():
    # Letters that only runs know, one for each component, none, no letters
    for mode in ("+", "i", "b", "ll", "**", "", 1):
        for run in (ns.simulate, ns.ensemble):
            with pytest.raises(ns.DefinitionError, match="mode"):
                run(_puck(), [0, 0, 0, 0], 2.0, start_mode=mode)


def test_a_start_off_a_set_continues_from_a_surface_that_repels():
    # A puck of known stopping time beside z' = sign z, which may go either way from z = 0.
    x, z = plane.columns("v1", "v2"), ca.SX.sym("z")
    lam, one = ca.vertcat(*plane.columns("l1", "l2")), ca.SX.sym("one")
    system = ns.FilippovSystem(
        [*x, z],
        field=[-0.5 * lam[0], -0.5 * lam[1], one],
        surfaces=[ca.vertcat(*x), z],
        multipliers=[lam, one],
    )
    run = lambda start, mode: ns.simulate(system, start, 3.0, start_mode=mode)
    start = [0.6, -0.8, 0.0]
    stopped = run(start, None)
    assert stopped.status == ns.Status.NON_UNIQUE
    assert "On h1 = 0" in stopped.message and "'*+', '*-'" in stopped.message
    for letter, z_end in [("+", 3.0), ("-", -3.0)]:
        found = run(start, "*" + letter)
        assert found.itinerary == f"*{letter} s{letter}"
        assert found.events[0].t == pytest.approx(2.0, abs=1e-11)
        assert found.x[-1] == pytest.approx([0.0, 0.0, z_end], abs=1e-11)
    held = run(start, "*s")  # the surface does not meet the puck, and continues as it is
    assert held.itinerary == "*s ss" and held.status == ns.Status.REACHED_END
    assert held.x[-1] == pytest.approx(np.zeros(3), abs=1e-11)
    for mode in ("s+", "ss"):
        with pytest.raises(ns.OptionError, match=r"^start_mode .*h0 = "):
            run(start, mode)
    with pytest.raises(ns.OptionError, match=r"^start_mode .*h1 = 2 \('\+'\)"):
        run([0.6, -0.8, 2.0], "*s")
    assert "start_mode '*+' has 0" in run([0.0, 0.0, 0.0], "*+").message


def test_ensembles_and_sections_meet_sets():
    starts = np.array([[0, 0, 0.6, 0.8], [0, 0, 0, 0], [0, 0, np.nan, 0]])
    many = ns.ensemble(_puck(), starts, 3.0, at_event=("entry", 1))
    assert many.itinerary.tolist() == ["* s", "s", ""]
    assert many.event_t[0] == pytest.approx(2.0, abs=1e-11)
    assert many.status[2] == ns.Status.NOT_FINITE
    run = ns.simulate(_puck(), starts[0], 3.0, at=ns.Section("h0", count=1))
    assert run.status == ns.Status.STOPPED and run.sample_t[0] == pytest.approx(2.0, abs=1e-11)


def test_runs_are_saved_with_their_system(tmp_path):
    run = ns.simulate(_puck(), [0, 0, 0.6, 0.8], 3.0)
    run.save(tmp_path / "run")
    again = ns.load(tmp_path / "run")
    assert again.system == run.system and again.itinerary == run.itinerary
    assert np.array_equal(again(1.7), run(1.7))
    assert repr(again.system).startswith(
        "FilippovSystem(4 states: x1, x2, v1, v2; set of codimension 2"
    )


def test_what_is_no_set_is_refused():
    v = plane.columns("v1", "v2", "v3", "v4")
    l1, l2 = plane.columns("l1", "l2")
    pair = ca.vertcat(v[0], v[1])
    for surfaces, multipliers, message in [
        ([pair], [l1], "multipliers"),
        ([v[0]], [ca.vertcat(l1, l2)], "multipliers"),
        ([ca.vertcat(*v)], [ca.SX.sym("l", 4)], "surface 0.*at most 3"),
        ([ca.SX.zeros(2, 2)], [ca.vertcat(l1, l2)], "surface 0.*matrix"),
    ]:
        with pytest.raises(ns.DefinitionError, match=message):
            ns.FilippovSystem(v, field=[0] * 4, surfaces=surfaces, multipliers=multipliers)
    with pytest.raises(ns.DefinitionError, match=r"multiplier \[l1, l2\].*linear"):
        ns.FilippovSystem(
            v, field=[l1 * l2, 0, 0, 0], surfaces=[pair], multipliers=[ca.vertcat(l1, l2)]
        )


@pytest.mark.parametrize(
    "question",
    [
        lambda system: ns.sliding_field(system, [0, 0, 0, 0]),
        lambda system: ns.local.two_fold(system, [0, 0, 0, 0]),
        lambda system: ns.regularise(system, 1e-3),
        lambda system: ns.find_fold(system, near=[0, 0, 0, 0]),
        lambda system: ns.local.sliding_branches(system, [0, 0, 0, 0]),
    ],
)
def test_functions_of_surfaces_refuse_sets(question):
    with pytest.raises(ns.DefinitionError, match="multipliers"):
        question(_puck())


_LANDINGS = st.tuples(*[st.floats(-1.5, 1.5) for _ in range(4)])


@pytest.mark.slow
@given(_LANDINGS, _LANDINGS, st.sampled_from([0.1, 0.6]), st.sampled_from([0.5, 1.5]))
@settings(max_examples=12, deadline=None)
def test_friction_brings_two_motions_closer(one, two, mu, eta):
    # |dV|^2 + k |dW|^2 + eta^2 |dX|^2 never rises: the rate of change is -4 d1 eta |dV|^2 + 2 dF.dh, and
    # friction is monotone. So the continuation is unique.
    p = {"mu": mu, "d1": 0.1, "d2": 0.1, "eta": eta, "G": 1e-4, "k": 0.4}
    runs = [_ball(s[:2], s[2:], tol=1e-12, p=p) for s in (one, two)]
    t = np.linspace(0.0, runs[0].t[-1], 60)
    dx, dv, dw, _ = np.split(runs[0](t) - runs[1](t), 4, axis=1)
    distance = (dv**2).sum(axis=1) + 0.4 * (dw**2).sum(axis=1) + eta**2 * (dx**2).sum(axis=1)
    assert np.diff(distance).max() < 1e-9


@pytest.mark.parametrize(
    ("v", "w", "itinerary"),
    [
        # |h| falls to where the series' coefficients are too large for numbers before it is rounding
        (
            (-2.2179224628908987, -1.0571153941954394),
            (-0.2217284807232749, 0.7005197913250095),
            "* s *",
        ),
        # and begins there
        (
            (-0.05658483122083673, -0.01184761529368745),
            (0.0565848312208363, 0.0118476152937),
            "s *",
        ),
    ],
)
def test_a_slip_next_to_rounding_is_none(v, w, itinerary):
    p = {"mu": 1.4326846432846805, "d1": 0.23, "d2": 0.26, "eta": 0.0868, "G": 1e-3, "k": 0.6}
    run = _ball(v, w, tol=1e-14, p=p)
    assert run.status == ns.Status.STOPPED and run.itinerary == itinerary


def test_a_slip_that_falls_to_rounding_slowly_ends():
    # Its last steps each end far from a tenth of it.
    p = {"mu": 1.4457164102791997, "d1": 0.30549677017535637, "d2": 0.03326735320558579}
    p |= {"eta": 1.0900828299229095, "G": 0.016207736400060048, "k": 0.6}
    v, w = (2.69033200272562, -1.4892391709366652), (2.7720083301603515, 3.5211825978719737)
    run, fine = (_ball(v, w, tol, p) for tol in (1e-14, 1e-12))
    assert run.status == ns.Status.STOPPED and run.itinerary == "* s *"
    assert np.abs(run.x[-1] - fine.x[-1]).max() < 1e-12


def test_a_line_crosses_again_within_the_step_that_left():
    # Along a line the series of leaving reaches far: to the next zero of slip, where it ends in rounding.
    p = {"mu": 0.05185574893987187, "d1": 0.3057990207800733, "d2": 0.2166692797028548}
    p |= {"eta": 1.4489698921967489, "G": 1.0660467368662658e-06, "k": 2 / 3}
    v, w = (-0.7954321571225536, 1.444639697247086), (-0.3073360719784702, 0.5581744288314956)
    run = _ball(v, w, 1e-13, p)
    axis = _ball([np.hypot(*v), 0.0], [np.hypot(*w), 0.0], 1e-13, p)
    assert run.itinerary == axis.itinerary == "* * *" and run.status == ns.Status.STOPPED
    assert np.hypot(*run.x[-1, 2:4]) == pytest.approx(abs(axis.x[-1, 2]), abs=1e-13)


def _winding(skew, size, **options):
    """h' = -c (1 + i skew) h/|h| in the complex plane winds into zero: its run, and the place, which is its integral."""
    x, lam, c = ca.SX.sym("x", 4), ca.SX.sym("lam", 2), 2.943
    force = -c * ca.vertcat(lam[0] - skew * lam[1], skew * lam[0] + lam[1])
    block = ns.FilippovSystem(
        ca.vertsplit(x), field=ca.vertcat(x[2:], force), surfaces=[x[2:]], multipliers=[lam]
    )
    run = ns.simulate(block, [0.0, 0.0, size, size], 5 * size, **options)
    return run, 2 * size**2 / c * np.exp(0.25j * np.pi) / (2 + 1j * skew)


@pytest.mark.parametrize("skew", [0.0, 2.0])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3, 1e6])
def test_a_set_is_reached_whatever_the_unit_of_time(size, skew):
    """Late in a long run the last part of the way is shorter than the rounding of the time."""
    run, place = _winding(skew, size, atol=1e-12 * size, rtol=1e-12)
    assert run.itinerary == "* s" and run.status is ns.Status.REACHED_END
    assert abs(run.events[0].t * 2.943 / (size * 2**0.5) - 1) < 1e-11
    assert abs(complex(*run.x[-1][:2]) - place) < 1e-11 * abs(place)


@pytest.mark.parametrize("k", [2, 3])
@pytest.mark.parametrize("seed", range(2))
def test_a_set_is_left_however_much_friction_depends_on_direction(seed, k):
    """A load t a grows until |M^-1 a| t = 1, with friction up to a hundred times stronger in one direction."""
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(k, k)))[0]
    m = axes @ np.diag(10 ** rng.uniform(-2, 0, k)) @ axes.T
    lam = rng.normal(size=k)
    a = m @ (lam / np.linalg.norm(lam))
    h, force, t = ca.SX.sym("h", k), ca.SX.sym("lam", k), ca.SX.sym("t")
    system = ns.FilippovSystem(
        ca.vertsplit(h), field=t * a - m @ force, surfaces=[h], multipliers=[force], time=t
    )
    run = ns.simulate(system, np.zeros(k), 1.5, tol=1e-12)
    assert run.itinerary == "s *" and run.status is ns.Status.REACHED_END
    assert run.events[0].t == pytest.approx(1.0, abs=1e-12)


T = ca.SX.sym("t")


#: Pulls on a set at rest, and when it is left: roots of |pull| - 1, by hand or of its polynomial.
PULLS = [
    ([1 + T, T], 0),
    ([1, T], 0),
    ([1 - 0.4 * T**2, T], 0),
    ([1 - 0.6 * T**2, T], (5 / 9) ** 0.5),
    ([1 - T**2 / 2 - 0.1 * T**3, T], 0.6307977539091055),
    ([1 - T**2 / 2 - T**4 / 10, T], 0),
    ([1 - T**2 / 2 - T**4 / 5, T], 0.8138044360707209),
    ([ca.cos(T), ca.sin(T)], None),
    ([0.6, T], 0.8),
]


@pytest.mark.parametrize("skew", [0.0, 0.5])
@pytest.mark.parametrize(
    ("pull", "leaves", "load"),
    # A direction of slip has no series where the load grows from zero.
    [(*case, load) for case in PULLS for load in ((1,) if case[1] == 0 else (1, T, T**2))],
)
def test_the_first_deciding_order_keeps_or_leaves_a_set(pull, leaves, load, skew):
    h, lam = ca.SX.sym("h", 2), ca.SX.sym("lam", 2)
    m = ca.DM([[1, skew], [skew, 1]])
    field = load * ca.mtimes(m, ca.vertcat(*pull) - lam)
    system = ns.FilippovSystem(h, field=field, surfaces=[h], multipliers=[lam], time=T)
    run = ns.simulate(system, [0.0, 0.0], 1.0)
    assert run.status is ns.Status.REACHED_END
    assert run.itinerary == ("*" if leaves == 0 else "s *" if leaves else "s")
    if leaves:
        assert run.events[0].t == pytest.approx(leaves, abs=1e-12)


@pytest.mark.parametrize("beside", [0, 1])
@pytest.mark.parametrize("k", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_friction_without_symmetry_leaves_along_its_direction(seed, k, beside):
    """(M + s) u = a and |u| = 1: h = s t u is a straight line, also beside a surface that it drives and is held."""
    rng = np.random.default_rng(seed)
    n = k + beside
    m = np.diag(rng.uniform(1, 2, n))
    m += 0.6 * np.triu(rng.normal(size=(n, n)), 1) - 0.4 * np.tril(rng.normal(size=(n, n)), -1)
    u, speed = rng.normal(size=k), 0.7
    u /= np.linalg.norm(u)
    h, lam, held = ca.SX.sym("h", n), ca.SX.sym("lam", k), ca.SX.sym("held", beside)
    force = ca.vertcat(lam, held)
    a = m @ np.append(u, [0.3] * beside) + speed * np.append(u, [0.0] * beside)
    system = ns.FilippovSystem(
        h,
        field=ca.DM(a) - ca.mtimes(ca.DM(m), force),
        surfaces=[h[:k], *ca.vertsplit(h[k:])[:beside]],
        multipliers=[lam, *ca.vertsplit(held)[:beside]],
    )
    run = ns.simulate(system, np.zeros(n), 2.0)
    assert run.itinerary == "*" + "s" * beside and run.status is ns.Status.REACHED_END
    assert run.x[-1] == pytest.approx(np.append(2.0 * speed * u, [0.0] * beside), abs=1e-12)


def test_sets_and_surfaces_that_act_on_one_another_in_any_units():
    """Coupled symmetric friction is the gradient of a convex dissipation: w and the motion are unique."""
    h, scale = ca.SX.sym("h", 5), 1 + 0.5 * ca.sin(2 * T)
    lam = [ca.SX.sym("p", 2), ca.SX.sym("q", 2), ca.SX.sym("r")]
    rng = np.random.default_rng(5)
    root = rng.normal(size=(5, 5))
    pull = rng.normal(size=5) * 3
    m = root @ root.T / 5 + 0.3 * np.eye(5)
    force = scale * ca.mtimes(ca.DM(m), ca.vertcat(*lam))
    system = ns.FilippovSystem(
        h, field=pull * ca.cos(T) - force, surfaces=[h[:2], h[2:4], h[4]], multipliers=lam, time=T
    )
    run = ns.simulate(system, np.zeros(5), 3.0)
    assert run.status is ns.Status.REACHED_END
    # A law of width 1e-5 in place of the jump, by an integrator of its own.
    norms = lambda v: np.concatenate(
        [part / np.hypot(1e-5, np.linalg.norm(part)) for part in (v[:2], v[2:4], v[4:])]
    )
    rate = lambda t, v: pull * np.cos(t) - (1 + 0.5 * np.sin(2 * t)) * (m @ norms(v))
    smooth = scipy.integrate.solve_ivp(
        rate, (0.0, 3.0), np.zeros(5), method="Radau", rtol=1e-8, atol=1e-9
    )
    assert run.x[-1] == pytest.approx(smooth.y[:, -1], abs=1e-4)


def test_a_tolerance_below_rounding_says_what_to_do():
    """Slip of 1e8 that winds into zero is known to 1e-8 of a second, and so to more than 1e-10 of its unit."""
    run, _ = _winding(2.0, 1e8)
    assert run.status is ns.Status.STEP_TOO_SMALL and "atol alone" in run.message
    run, place = _winding(2.0, 1e8, atol=1e-4)
    assert run.itinerary == "* s" and abs(complex(*run.x[-1, :2]) / place - 1) < 1e-11
