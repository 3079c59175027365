"""Proven orbits enclose closed forms; undecided ones are not proven."""

import casadi as ca
import mpmath
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.proofs.orbits.itinerary import OrbitEnclosure
from tests.proofs.systems import STICK, drop, holds, t, v, x

w = ca.SX.sym("w")


def test_stick_slip_has_the_events_of_the_closed_form():
    orbit = ns.certify_orbit(STICK, [0, 0], t_end=5)
    assert orbit.proven and orbit.itinerary == "- s -"
    with mpmath.workdps(40):
        # Slip x = 1 - cos t until sin t = 1/2; stick until x = 1.
        entry = mpmath.pi / 6
        exit_ = entry + (1 - (1 - mpmath.cos(entry))) / mpmath.mpf("0.5")
        assert holds(orbit.events[0].t, entry) and orbit.events[0].t.radius < 1e-17
        assert holds(orbit.events[1].t, exit_) and orbit.events[1].kind == "exit"
        assert holds(orbit.events[1].x["x"], mpmath.mpf(1))


@pytest.mark.slow
def test_a_nonlinear_orbit_agrees_with_mpmath_at_30_digits():
    s = ns.FilippovSystem(
        [x, v], surface=x - 5, above=[1, 1], below=[v, (1 - x**2) * v - ca.sin(x)]
    )
    orbit = ns.certify_orbit(s, ["0.5", "0"], t_end="1", bits=128)
    assert orbit.proven and orbit.itinerary == "-"
    with mpmath.workdps(30):
        f = lambda t, y: [y[1], (1 - y[0] ** 2) * y[1] - mpmath.sin(y[0])]
        end = mpmath.odefun(f, 0, [mpmath.mpf("0.5"), mpmath.mpf(0)])(1)
        for value, exact in zip(orbit.end.values(), end, strict=True):
            assert value.radius < 1e-30
            assert abs(mpmath.mpf(value.low) - exact) < mpmath.mpf(10) ** -24


@pytest.mark.slow_cases("2", "3")
@pytest.mark.parametrize("seed", range(4))
def test_itineraries_and_times_are_those_of_simulate(seed):
    rng = np.random.default_rng(seed)
    above, below = rng.normal(size=(2, 3, 3))
    states = ca.vertcat(x, v, w)
    fields = [
        ca.vertsplit(ca.mtimes(ca.DM(a), states) + ca.DM(rng.normal(size=3)) - 0.1 * states**3)
        for a in (above, below)
    ]
    s = ns.FilippovSystem([x, v, w], surface=x + 0.1 * v * w, above=fields[0], below=fields[1])
    start = rng.normal(size=3)
    orbit = ns.certify_orbit(s, list(start), t_end=1.5, max_bits=64)
    run = ns.simulate(s, start, t_end=1.5, rtol=1e-12, atol=1e-13)
    if not orbit.proven:
        assert orbit.why and run.status != ns.Status.REACHED_END
        return
    assert orbit.itinerary == run.itinerary
    for event, other in zip(orbit.events, run.events, strict=False):
        assert event.t.middle == pytest.approx(other.t, abs=1e-8)
    assert [e.middle for e in orbit.end.values()] == pytest.approx(list(run.x[-1]), abs=1e-7)


@pytest.mark.parametrize(
    ("t_end", "bits", "width"),
    [(10, 64, 4e-17), (50, 128, 2e-31)],
)
def test_no_more_digits_are_lost_than_the_flow_loses(t_end, bits, width):
    """Chua's circuit: derivatives by the start are 200 at t = 10 and 3e7 at t = 50, times 2^-bits about the width."""
    above, below = ca.SX.sym("above"), ca.SX.sym("below")
    f = -5 / 7 * x - 3 / 14 * ((x + 1) * above - (x - 1) * below)
    field = [9 * (v - x - f), x - v + w, -14.286 * v]
    s = ns.FilippovSystem(
        [x, v, w], field=field, surfaces=[x + 1, x - 1], multipliers=[above, below]
    )
    orbit, fine = (
        ns.certify_orbit(s, ["0.1", "0.2", "0.3"], t_end, bits=b, max_bits=b, max_steps=4000)
        for b in (bits, bits + 64)
    )
    assert orbit.proven and max(e.radius for e in orbit.end.values()) < width
    assert len(orbit.events) == len(fine.events) == (9 if t_end == 10 else 31)
    for name, value in fine.end.items():
        low, high = orbit.end[name].ends
        assert low <= value.ends[0] <= value.ends[1] <= high


@pytest.mark.slow
def test_boxes_hold_the_orbits_from_their_points():
    box = [(-0.01, 0.01), (-0.005, 0.005)]
    orbit = ns.certify_orbit(STICK, box, t_end=2)
    assert (orbit.proven and orbit.itinerary == "- s -") or orbit.itinerary == "- s"
    rng = np.random.default_rng(3)
    for start in rng.uniform(*np.array(box).T, size=(8, 2)):
        point = ns.certify_orbit(STICK, list(start), t_end=2)
        assert point.itinerary == orbit.itinerary
        for name, value in point.end.items():
            assert orbit.end[name].ends[0] <= value.ends[0]
            assert value.ends[1] <= orbit.end[name].ends[1]
        assert point.events[0].t.ends[0] >= orbit.events[0].t.ends[0]


def test_resets_stops_and_time():
    slow, fast = (drop(ns.Stop(v - speed, 1, "fast")) for speed in (0.75, 1.25))
    orbit = ns.certify_orbit(fast, [1, 0], t_end=1.75)  # comes back with half its speed
    kinds = [e.kind for e in orbit.events]
    assert orbit.proven and kinds[0] == "reset" and holds(orbit.events[0].t, mpmath.mpf(1))
    # A jump that leads across a stop fires it: that is not proven.
    assert not ns.certify_orbit(slow, [1, 0], t_end=1.75).proven
    forced = ns.FilippovSystem(
        [x],
        surface=x - 2,
        above=[1],
        below=[ca.cos(t)],
        time=t,
        stops=[ns.Stop(x - 0.5, 1, "half")],
    )
    orbit = ns.certify_orbit(forced, [0], t_end=3)
    assert orbit.status == "half" and holds(orbit.t, mpmath.asin(mpmath.mpf("0.5")))


def test_a_graze_a_two_fold_and_a_wide_box_are_not_proven():
    graze = ns.FilippovSystem([x, v], surface=v, above=[1, 2 * x], below=[1, 1])
    orbit = ns.certify_orbit(graze, [-1, 1], t_end=2)  # v = x^2: touches at x = 0
    assert not orbit.proven and "undecided" in orbit.why and orbit.itinerary == "+"
    for near, itinerary in ((1 + 1e-9, "+"), (1 - 1e-9, "+ s +")):
        orbit = ns.certify_orbit(graze, [-1, near], t_end=1.5)
        assert orbit.itinerary.startswith(itinerary)
    wide = ns.certify_orbit(STICK, [(-2, 3), (-1, 2)], t_end=2)
    assert not wide.proven and wide.why


def test_the_field_may_not_be_defined_all_the_way():
    s = ns.FilippovSystem([x], surface=x + 9, above=[-ca.sqrt(x)], below=[1])
    orbit = ns.certify_orbit(
        s, [1], t_end=3, max_steps=15, max_bits=64
    )  # (1 - t/2)^2 ends at t = 2
    assert not orbit.proven and float(orbit.t.high) <= 2
    blow = ns.FilippovSystem([x], surface=x + 9, above=[x**2], below=[1])
    orbit = ns.certify_orbit(blow, [1], t_end=1.5, max_steps=15, max_bits=64)
    assert not orbit.proven and float(orbit.t.high) < 1


def test_coincident_fields_slide_through_their_two_fold():
    """F1 - F2 has a factor that vanishes where both fields are tangent; cancelled, sliding is smooth."""
    lam = ca.SX.sym("lam")
    s = ns.FilippovSystem(
        [x, v], surface=v, multipliers=lam, field=[1, -0.25 * lam * (1 - x) / 2.0 + 0.1 * (1 - x)]
    )
    orbit = ns.certify_orbit(s, [0, "0.01"], t_end="0.75")
    assert orbit.proven and orbit.itinerary == "+ s"
    assert holds(orbit.end["v"], mpmath.mpf(0))


def test_what_is_given_wrongly_is_refused():
    s = ns.FilippovSystem([x, v], surface=v, above=[1, -1], below=[1, 1])
    with pytest.raises(ns.PointError, match="x0"):
        ns.certify_orbit(s, [1], t_end=1)
    with pytest.raises(ns.OptionError, match="t_end"):
        ns.certify_orbit(s, [1, 1], t_end=-1)
    with pytest.raises(ns.OptionError, match="numbers='decimal'"):
        ns.certify_orbit(s, [1, 1], t_end=1, numbers="decimal")
    with pytest.raises(ns.OptionError, match="start of 'x'"):
        ns.certify_orbit(s, [np.nan, 1], t_end=1)


def test_a_start_on_the_surface_is_recognised_exactly():
    s = ns.FilippovSystem([x, v], surface=v - 0.1 * x, above=[1, -1], below=[1, 2 - x])
    orbit = ns.certify_orbit(s, ["3/10", "3/100"], t_end=1, numbers="written")
    assert orbit.proven and orbit.itinerary == "s"
    orbit = ns.certify_orbit(s, ["3/10", "0.0300000001"], t_end=1, numbers="written")
    assert orbit.itinerary == "+ s"
    undecided = ns.certify_orbit(s, [("0.29", "0.31"), "3/100"], t_end=1, numbers="written")
    assert not undecided.proven and "undecided" in undecided.why


@pytest.mark.slow
def test_a_guard_is_not_followed_over_its_jump():
    """atan2 jumps where the orbit crosses the negative axis; Taylor series know nothing beyond."""
    angle = ns.FilippovSystem(
        [x, v], field=[0 * x, -1], stops=[ns.Stop(ca.atan2(v, x), -1, "angle")]
    )
    orbit = ns.certify_orbit(angle, [-1, 0.5], t_end=1)
    assert not orbit.proven and float(orbit.t.high) < 0.5
    pole = ns.FilippovSystem([x], field=[1], stops=[ns.Stop(1 / x - 0.25, 1, "pole")])
    orbit = ns.certify_orbit(pole, [-1], t_end=2)
    assert not orbit.proven and float(orbit.t.high) < 1
    field = ns.FilippovSystem([x, v], field=[ca.atan2(v, x) / 1024, -1])
    orbit = ns.certify_orbit(field, [-1, 0.5], t_end=1, max_steps=40)
    assert not orbit.proven and float(orbit.t.high) < 0.5


def test_an_interrupt_ends_the_proof_with_what_was_proven(monkeypatch):
    orbit = OrbitEnclosure
    step_through, calls = orbit.step_through, []

    def interrupted(self):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return step_through(self)

    monkeypatch.setattr(orbit, "step_through", interrupted)
    orbit = ns.certify_orbit(STICK, [0, 0], t_end=3)
    assert len(calls) == 2 and orbit.why == "interrupted" and not orbit.proven
