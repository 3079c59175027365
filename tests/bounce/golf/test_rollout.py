"""The run-out agrees with closed forms: the Zeno sum of bounces, sliding into rolling, rolling to rest; with side
spin it turns and mirrors with the landing."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bounce
import nonsmooth as ns
from bounce.golf import SMITS_SMITH, SideState, play
from tests.drawing import at_most

G = 9.80665
R = bounce.golf.GOLF.radius
DRIVE = bounce.Landing.polar(28.5, math.radians(37.3), 2094)
NATURAL = bounce.laws.TURFS["natural"].law
SOFT = bounce.KelvinVoigt(mu=0.5, d1=0.1, d2=0.5, eta=0.3)
SCALING = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 20e3)


@at_most(20)
@given(r=st.floats(0.1, 0.8), u=st.floats(-20, 20), v=st.floats(0.5, 20))
def test_zeno_sum(r, u, v):
    """Rolling and constant restitution: hops of 2 u r^n v/g for n = 1, 2, ..., 2 u v r/(g (1-r)) in all."""
    landing = bounce.Landing(u, -v, -u / R)
    law = bounce.laws.RigidBounce(mu=0.4, restitution=r)
    run = bounce.golf.play(law, landing, min_height=1e-14, rolling_friction=1e9)
    assert run.bounced == pytest.approx(2 * u * v * r / (G * (1 - r)), abs=1e-6 * (1 + abs(u)))
    assert run.bounces[-1].t == pytest.approx(2 * v * r / (G * (1 - r)), abs=1e-6)
    assert run.first_height == pytest.approx((r * v) ** 2 / (2 * G))
    heights = [b.hop.height for b in run.bounces if b.hop is not None]
    assert heights[1:] == pytest.approx([h * r**2 for h in heights[:-1]])


@given(v=st.floats(0.1, 5), rho=st.floats(0.02, 0.5))
def test_rolling_to_rest(v, rho):
    """x = v^2 (1 + k)/(2 rho g); a Stimpmeter's 1.83 m/s on rho = .131 rolls 1.83 m (6 feet)."""
    run = bounce.golf.play(
        bounce.laws.RigidBounce(mu=0.4, restitution=0.0),
        bounce.Landing(v, -1e-3, -v / R),
        rolling_friction=rho,
    )
    assert run.rolled == run.run_out == pytest.approx(v**2 * 1.4 / (2 * rho * G), rel=1e-12)
    assert [g.mode for g in run.glides] == ["s"]


def test_stimpmeter():
    run = bounce.golf.play(
        bounce.laws.RigidBounce(mu=0.4, restitution=0.0), bounce.Landing(1.83, -1e-3, -1.83 / R)
    )
    assert run.run_out / 0.3048 == pytest.approx(6.0, abs=0.02)


@given(u=st.floats(-5, 5), spin=st.floats(-8, 8), slope=st.floats(-0.05, 0.05))
def test_sliding_becomes_rolling(u, spin, slope):
    """The law keeps the ball down, so it slides: 5/7 u - 2/7 R omega is what it rolls with on the level."""
    law = bounce.laws.RigidBounce(mu=0.3, restitution=0.0)
    run = bounce.golf.play(law, bounce.Landing(u, -1e-9, spin / R), slope=slope)
    if run.glides and run.glides[0].mode in "+-":
        slide = run.glides[0]
        after = slide.xdot + slide.acceleration * slide.time
        if slope == 0.0:
            assert after == pytest.approx(5 / 7 * u - 2 / 7 * spin, abs=1e-7)
        assert slide.time > 0.0
    path = run.path()
    assert np.all(np.diff(path[:, 0]) >= -1e-12)
    assert path[-1, 1] == pytest.approx(run.run_out, abs=1e-12)
    assert path[-1, 0] == pytest.approx(run.time, abs=1e-12)


def test_backspin_runs_back():
    run = bounce.golf.play(
        bounce.laws.TiltedBounce(mu=0.4, restitution=0.2, tilt=math.radians(20)),
        bounce.Landing.polar(20.0, math.radians(60), 9000),
    )
    assert run.run_out < 0.0


@pytest.mark.filterwarnings("ignore::bounce.golf.ExtrapolationWarning")
@pytest.mark.parametrize("name", bounce.laws.TURFS)
def test_energy_decreases_from_bounce_to_bounce(name):
    run = bounce.golf.play(bounce.laws.TURFS[name].law, DRIVE, air=bounce.golf.SMITS_SMITH)

    def energy(s):
        return s.xdot**2 + s.ydot**2 + 0.4 * (R * s.omega) ** 2

    for b in run.bounces:
        assert energy(b.rebound.lift_off) <= energy(b.rebound.landing) * (1 + 1e-12)
    assert run.path()[:, 2].min() > -1e-9
    assert 0.0 <= run.left_out < 1.0


def test_known_run_of_a_drive():
    """A public simulator with the same law, no drag and its own stop at 0.3 m/s gives 25 yards."""
    run = bounce.golf.play(bounce.laws.TURFS["natural"].law, DRIVE)
    assert run.run_out / 0.9144 == pytest.approx(25.0, abs=0.5)


def test_contact_model_with_gravity_and_displacement():
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 2e4)
    turf = bounce.KelvinVoigt(mu=0.5, d1=0.2, d2=0.4, eta=0.7, G=scaling.gravity)
    run = bounce.golf.play(turf, DRIVE, scaling=scaling)
    first = run.bounces[0]
    assert first.rebound.time > 0.0 and first.rebound.y < 0.0
    assert run.bounces[1].x == pytest.approx(first.rebound.x + first.hop.range)
    assert run.bounces[1].t == pytest.approx(first.rebound.time + first.hop.time)


def test_slopes():
    law = bounce.laws.RigidBounce(mu=0.4, restitution=0.0)
    landing = bounce.Landing(1.0, -1e-3, -1.0 / R)
    level, up = (bounce.golf.play(law, landing, slope=s).run_out for s in (0.0, 0.05))
    down = bounce.golf.play(law, landing, slope=-0.05).run_out
    assert up < level < down
    steep = bounce.golf.play(law, landing, slope=0.2, rolling_friction=0.25)
    assert len(steep.glides) == 1
    with pytest.raises(bounce.golf.NoRestError, match="slope"):
        bounce.golf.play(law, landing, slope=0.2)
    with pytest.raises(bounce.golf.NoRestError, match="slope"):
        bounce.golf.play(law, bounce.Landing(-5.0, -1e-3, -400.0), slope=1.0)


@pytest.mark.filterwarnings("ignore::bounce.golf.ExtrapolationWarning")
@pytest.mark.parametrize(
    "model, more",
    [(NATURAL, {}), (NATURAL, dict(slope=0.03, air=SMITS_SMITH)), (SOFT, dict(scaling=SCALING))],
    ids=["natural", "natural uphill in air", "compliant"],
)
def test_a_run_without_side_spin_is_the_planar_one(model, more):
    one = play(model, DRIVE, tol=1e-12, **more)
    other = play(model, SideState.of(DRIVE), tol=1e-12, **more)
    assert len(one.bounces) == len(other.bounces) and one.extrapolated == other.extrapolated
    assert one.cautions == other.cautions
    assert [other.run_out, other.side] == pytest.approx([one.run_out, 0.0], rel=1e-8, abs=1e-8)
    for name in ("bounced", "rolled", "left_out"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-8, abs=1e-8)
    assert other.time == pytest.approx(one.time, rel=1e-8)
    assert other.first_height == pytest.approx(one.first_height, rel=1e-8)
    flat = np.column_stack([one.path(), np.zeros(len(one.path()))])
    assert other.path() == pytest.approx(flat, rel=1e-7, abs=1e-7)


@pytest.mark.filterwarnings("ignore::bounce.golf.ExtrapolationWarning")
def test_a_run_turns_and_mirrors_with_its_landing():
    landing = SideState.of(DRIVE, 80.0, -200.0)
    one = play(NATURAL, landing)
    left = play(NATURAL, SideState.of(DRIVE, -80.0, 200.0))
    assert [left.run_out, -left.side] == pytest.approx([one.run_out, one.side], rel=1e-12)
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    other = play(NATURAL, SideState(turn @ landing.velocity, turn @ landing.spin))
    rest = turn @ [one.run_out, 0.0, one.side]
    assert [other.run_out, other.side] == pytest.approx(rest[[0, 2]], rel=1e-8)
    hit = bounce.golf.rebound(NATURAL, landing)
    assert left.kick == -one.kick and one.kick == pytest.approx(hit.kick, rel=1e-12)


def test_a_ball_that_stays_down_is_a_cue_ball():
    """Coriolis: it slides for 2|h|/(7 mu g) on a parabola and rolls on with 2/7 of the slip taken off."""
    ball = bounce.golf.GOLF
    law = bounce.laws.RigidBounce(mu=0.05, restitution=0.0)
    run = play(law, SideState([3.0, -1.0, 0.5], [60.0, 5.0, 200.0]), rolling_friction=0.2)
    (first,) = run.bounces
    off = first.rebound.lift_off
    v = off.velocity[[0, 2]]
    h = v + ball.radius * np.array([off.spin[2], -off.spin[0]])
    slid = 2 * np.hypot(*h) / (7 * 0.05 * G)
    rolls = v - 2 / 7 * h
    at = v * slid - 0.05 * G * h / np.hypot(*h) * slid**2 / 2
    way = 1.4 * np.hypot(*rolls) / (2 * 0.2 * G)
    slides, rolling = run.glides
    assert slides.time == pytest.approx(slid, rel=1e-9) and off.velocity[1] == 0.0
    assert [run.run_out, run.side] == pytest.approx(at + way * rolls, rel=1e-9)
    assert rolling.time == pytest.approx(1.4 * np.hypot(*rolls) / (0.2 * G), rel=1e-9)
    assert "to the right" in repr(run)


def test_a_ball_rolls_down_a_side_slope_and_comes_to_rest():
    """Energy: what gravity and the resistance along the way leave is nothing."""
    law = bounce.laws.RigidBounce(mu=0.5, restitution=0.0)
    state = SideState([4.0, -1.0, 0.0], [0.0, 0.0, -4.0 / bounce.golf.GOLF.radius])
    run = play(law, state, side_slope=0.05, rolling_friction=0.2)
    (glide,) = run.glides
    t = np.linspace(0.0, glide.time, 20001)
    x = glide(t)
    length = float(np.sum(np.hypot(*np.diff(x[:, :2], axis=0).T)))
    begun = 0.7 * float(x[0, 2:] @ x[0, 2:])
    fallen = -math.sin(0.05) * G * run.side
    assert run.side < 0 and begun + fallen == pytest.approx(
        0.2 * G * math.cos(0.05) * length, rel=1e-7
    )
    with pytest.raises(bounce.golf.NoRestError, match="slope"):
        play(law, state, side_slope=0.3)
    with pytest.raises(bounce.golf.NoRestError, match="slope"):
        slippery = bounce.laws.RigidBounce(mu=0.01, restitution=0.0)
        play(slippery, SideState([4.0, -1.0, 0.0], [0.0, 0.0, 0.0]), side_slope=0.3)


def test_on_a_side_slope_a_ball_slides_until_it_rolls():
    """Sliding friction does not change v - 2/7 of the slip; only 5/7 of the pull along the ground does."""
    law, ball = bounce.laws.RigidBounce(mu=0.1, restitution=0.0), bounce.golf.GOLF
    state = SideState([4.0, -1.0, 0.0], [0.0, 0.0, 200.0])
    run = play(law, state, side_slope=0.05, rolling_friction=0.2)
    slides, rolls = run.glides
    assert (slides.mode, rolls.mode) == ("*", "s") and rolls.t == run.bounces[0].t + slides.time
    assert slides(slides.time) == pytest.approx(rolls(0.0), abs=1e-9)
    off = run.bounces[0].rebound.lift_off
    v = off.velocity[[0, 2]]
    slip = v + ball.radius * np.array([off.spin[2], -off.spin[0]])
    pull = np.array([0.0, -math.sin(0.05) * G])
    expected = v - 2 / 7 * slip + 5 / 7 * pull * slides.time
    assert rolls(0.0)[2:] == pytest.approx(expected, rel=1e-8)


def test_times_of_the_path_include_those_of_contact():
    run = play(SOFT, SideState.of(DRIVE, 80.0), scaling=SCALING)
    first, second = run.bounces[:2]
    assert first.rebound.time > 0.0
    assert second.t == pytest.approx(first.rebound.time + first.hop.time)
    assert run.path(2)[2, 0] == pytest.approx(second.t)
    assert (second.x, second.z) == pytest.approx(
        (first.rebound.x + first.hop.range, first.rebound.z + first.hop.side)
    )


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (dict(rolling_friction=0.0), ns.OptionError, "rolling_friction"),
        (dict(min_height=-1.0), ns.OptionError, "min_height"),
        (dict(slope=3.0), ns.OptionError, "slope"),
        (dict(max_bounces=3), bounce.golf.NoRestError, "max_bounces"),
    ],
)
def test_messages(options, error, message):
    with pytest.raises(error, match=message):
        bounce.golf.play(bounce.laws.TURFS["artificial"].law, DRIVE, **options)


def test_model_messages():
    turf = bounce.KelvinVoigt(mu=0.5, d1=0.2, d2=0.4, eta=0.7)
    scaling = bounce.Scaling.from_stiffness(bounce.golf.GOLF, 2e4)
    with pytest.raises(ns.OptionError, match="slope"):
        bounce.golf.play(turf, DRIVE, scaling=scaling, slope=0.1)
    with pytest.raises(bounce.LandingError):
        bounce.golf.play(NATURAL, bounce.Landing(1.0, 1.0, 0.0))
    state = SideState([1.0, -2.0, 0.0], [0.0, 0.0, 0.0])
    with pytest.raises(ns.OptionError, match="slope"):
        play(SOFT, state, scaling=SCALING, slope=0.1)
    with pytest.raises(ns.OptionError, match="min_height"):
        play(NATURAL, state, min_height=0.0)
    with pytest.raises(bounce.golf.NoRestError, match="max_bounces"):
        play(bounce.laws.RigidBounce(mu=0.3, restitution=1.0), state, max_bounces=5)
    with pytest.raises(ns.OptionError, match="side_slope"):
        play(NATURAL, DRIVE, side_slope=0.1)
