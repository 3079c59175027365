"""Each program of the gallery runs, draws, and computes the numbers that its page speaks of.

The numbers come from outside the programs: closed forms, and the references of the textbook.
"""

import math
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.optimize import brentq

import nonsmooth as ns
from docs.tools import generate
from papers.pictures import faults

#: The period of docs/examples/friction/stick_slip.py: both fields are linear, so the slip ends at a root of
#: a sum of exponentials, found here to 30 digits with mpmath.
PERIOD = 6.736837191765135


#: Programs that take seconds: they run among the slow tests.
DEAR = {
    *("atlas", "basins", "belt", "buck", "friction_drive", "harvest", "impact", "plane_friction"),
    *("hybrid", "pushed_block", "relay", "walker", "wells"),
}
EACH = [
    pytest.param(name, marks=[pytest.mark.slow] if name in DEAR else [])
    for name in generate.GALLERY
]


@cache
def ran(name):
    """What a program of the gallery defines."""
    return generate.run_example(name)


@pytest.mark.slow_cases(
    "two_fold",
    "two_fold_space",
    "stick_slip",
    "leine",
    "friction_cone",
    "outcome_map",
    "slip_directions",
)
@pytest.mark.parametrize("name", EACH)
def test_picture_is_legible_on_a_page(name):
    """It fits one: as wide as a page at most, text of 8 points, nothing cut off."""
    for figure in generate.drawn(name, ran(name)).values():
        assert isinstance(figure, Figure)
        assert faults(figure) == []
        assert figure.get_figheight() <= 9.0


@pytest.mark.slow
@pytest.mark.parametrize("name", generate.GALLERY)
def test_program_draws(name, tmp_path):
    for figure in generate.drawn(name, ran(name)).values():
        figure.savefig(tmp_path / "picture.svg")
        assert (tmp_path / "picture.svg").stat().st_size > 5_000


def test_gallery_is_all_programs():
    assert sorted(generate.GALLERY) == sorted(p.stem for p in generate.EXAMPLES.glob("*/*.py"))


def test_two_fold_is_the_teixeira_singularity():
    fold = ran("two_fold")["fold"]
    assert (fold.label, fold.sigma) == ("II-C", (-1, 1))
    assert fold.nu == pytest.approx((-2, -1), abs=1e-12)


def test_diabolo():
    found = ran("two_fold_space")
    assert found["expanding"] == pytest.approx(2 - math.sqrt(2), abs=1e-12)
    assert found["contracting"] == pytest.approx(2 + math.sqrt(2), abs=1e-12)
    assert found["time_to_fold"] == pytest.approx(1 + 2 * math.sqrt(2), abs=1e-11)


@pytest.mark.slow
def test_atlas_counts_canards():
    counts = {k: (c.canards, c.faux_canards) for k, c in ran("atlas")["classes"].items()}
    inf = math.inf
    assert counts == {
        "VV-C1": (1, 0),
        "VV-F": (0, inf),
        "II-C": (inf, 0),
        "II-F": (0, 1),
        "mix-0": (0, 0),
        "mix-S": (1, 1),
        "mix-C": (inf, 0),
        "mix-F": (0, inf),
    }


def test_funnel_begins_where_the_canard_meets_the_two_fold():
    found = ran("funnel")
    golden = (1 + math.sqrt(5)) / 2  # slope of the canard for nu = (-2, -1)
    assert found["slope"] == pytest.approx(golden, abs=1e-12)
    # on an eigenline t = (z2 + z3)/|lambda|, with lambda = -(1 + slope)
    assert found["futures"].t == pytest.approx(0.5, abs=1e-9)
    assert {d.side for d in found["futures"].departures} == {"+", "-", "s"}


@pytest.mark.slow
def test_limit_directions_of_plane_friction():
    found = ran("plane_friction")
    assert [d.rate for d in found["directions"]] == pytest.approx([-0.4, -1.6], abs=1e-12)
    x, y = np.meshgrid(found["loads"], found["loads"])
    inside = np.abs(x) ** (2 / 3) + np.abs(y) ** (2 / 3) < found["width"] ** (2 / 3)
    assert np.array_equal(found["counts"], np.where(inside, 4, 2))


def test_the_vortex_of_slip_directions():
    found = ran("slip_directions")
    (cell,) = found["directions"].vortices
    assert cell.winding == 1
    width = [np.diff(values)[0] for values in found["spins"]]
    assert np.all(np.abs(cell.omega - found["vortex"]) <= width)
    error = np.abs(found["turned"].turn - found["turned"].first_order)
    assert error[0] < 0.3 * error[1] < 0.09 * error[2]  # of second order


def test_stick_slip_period():
    found = ran("stick_slip")
    assert found["period"] == pytest.approx(PERIOD, abs=1e-9)
    assert [e.x[0] for e in found["exits"]] == pytest.approx([0.5] * 5, abs=1e-10)


def test_period_of_stick_slip_in_high_precision():
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(30):
        a, c = mpmath.mpf("0.1"), mpmath.mpf("0.44")  # x'' - 2 a x' + x = c while it slips
        w = mpmath.sqrt(1 - a**2)
        p = mpmath.mpf("0.5") - c
        q = (mpmath.mpf("0.3") - a * p) / w

        def x(t):
            return c + mpmath.exp(a * t) * (p * mpmath.cos(w * t) + q * mpmath.sin(w * t))

        slip = mpmath.findroot(lambda t: mpmath.diff(x, t) - mpmath.mpf("0.3"), 5.3)
        period = slip + (mpmath.mpf("0.5") - x(slip)) / mpmath.mpf("0.3")
    assert float(period) == pytest.approx(PERIOD, abs=1e-14)


def test_leine_oscillator():
    found = ran("leine")
    assert found["problem"]["period"].agrees(found["period"])
    assert found["problem"]["stick time"].agrees(found["stick_time"])


@pytest.mark.slow
def test_harvest_has_a_saddle_and_a_node():
    found = ran("harvest")
    saddle, node = found["pseudo"]
    assert (saddle.kind, node.kind) == ("pseudo-saddle", "stable pseudo-node")
    a, b = (found["problem"].parameters[k] for k in "ab")
    half = math.sqrt((1 + b) ** 2 - 4 * a * 1.06) / 2  # (1 - x1)(b + x1) = a alpha
    centre = (1 - b) / 2
    assert saddle.point[0] == pytest.approx(centre - half, abs=1e-10)
    assert node.point[0] == pytest.approx(centre + half, abs=1e-10)


@pytest.mark.slow
def test_every_block_comes_to_rest():
    found = ran("basins")
    assert found["at_rest"].all()
    share = found["share"]
    assert share["left"] == share["right"]  # the system is odd, and so is the grid
    assert share["left"] + share["hill"] + share["right"] == pytest.approx(1)
    x = found["many"].x[..., 0]
    assert np.abs(x - x**3).max() <= 0.08 + 1e-9  # within reach of static friction


def test_bounce_goes_into_reverse():
    shot = ran("friction_cone")["shot"]
    assert shot.itinerary == "+ s -"
    assert shot.slip < 0


@pytest.mark.slow
def test_dividing_curve_divides_the_map():
    found = ran("outcome_map")
    curve, slip = found["curve"], found["outcomes"].slip
    speeds, spins = found["speeds"], found["spins"]
    inside = np.abs(speeds) < 0.4  # where the curve is one spin for each speed
    above = spins[:, None] > curve.omega(speeds[inside])
    assert np.mean((slip[:, inside] > 0) == above) > 0.998


@pytest.mark.slow
def test_wells_are_divided_where_the_closed_form_says():
    wells = ran("wells")
    zeta = 0.1
    truth = 1 + math.exp(zeta * math.pi / math.sqrt(1 - zeta**2))
    assert wells["threshold"] == pytest.approx(truth, abs=1e-7)
    labels, (xs, vs) = wells["found"].labels, wells["found"].axes.values()
    assert set(np.unique(labels)) == {1, 2}
    assert np.array_equal(labels, 3 - labels[::-1, ::-1])  # the system is odd
    row = labels[:, int(np.argmin(abs(vs)))]
    beyond = (xs > truth + 0.1) & (xs < 3.2)
    assert len(set(row[(xs > 0.2) & (xs < truth - 0.1)])) == 1
    assert set(row[beyond]).isdisjoint(row[(xs > 0.2) & (xs < truth - 0.1)])


@pytest.mark.slow
def test_buck_converter_doubles_where_its_closed_form_flows_say():
    """The first from the textbook's reference; at the second a multiplier -1 by differences of runs."""
    found = ran("buck")
    assert found["doublings"][0] == pytest.approx(24.51657282856337870174, abs=1e-10)
    event = found["branches"][1].events[0]
    legs = event.orbit.legs
    start = next(
        legs[(k + 1) % len(legs)] for k, leg in enumerate(legs) if leg.event == "clock"
    ).start

    def after(change):
        run = found["ns"].simulate(
            found["system"],
            [*(start[:2] + change), 0.0],
            8.1e-4,
            parameters={"E": event.parameter},
            tol=1e-12,
            at=found["ns"].Section("clock", after=True, count=2),
        )
        return run.sample_x[-1, :2]

    step = 1e-6 * np.eye(2)
    slope = np.column_stack([(after(d) - after(-d)) / 2e-6 for d in step])
    assert np.abs(np.linalg.eigvals(slope) + 1).min() < 1e-5
    assert len(found["doublings"]) == 3 and np.all(np.diff(found["doublings"]) > 0)


@pytest.mark.slow
def test_forced_friction_is_den_hartogs():
    """Amplitudes of motions without a stop, and where the first stop is, from their closed forms."""
    found = ran("friction_drive")
    seen = 0
    for family in found["families"]:
        for W, orbit in zip(family.values, family.solutions, strict=True):
            friction = orbit.parameters["f"]
            if friction < 0.99 * found["first_stop"](W):
                assert "s" not in orbit.itinerary
                truth = found["amplitude"](W, friction)
                assert found["largest"](orbit) == pytest.approx(truth, rel=1e-10)
                seen += 1
            elif friction > 1.01 * found["first_stop"](W):
                assert "s" in orbit.itinerary
    assert seen > 100 and len(found["curves"]) == 2
    for curve in found["curves"]:
        W, friction = curve.values.T
        assert np.abs(friction - found["first_stop"](W)).max() < 1e-10


@pytest.mark.slow
def test_curves_of_the_pushed_block_in_closed_form():
    """Lines of grazing and of adding-sliding, and the four points at which curves meet."""
    found = ran("pushed_block")
    curves, points = found["curves"], [point.values for point in found["points"]]
    assert all(not curve.solution(k).is_virtual for curve in curves for k in range(len(curve)))
    for curve in curves:
        push, amplitude = np.abs(curve.values.T)
        if curve.kind == "grazing-sliding":
            assert np.abs(push - 1 - amplitude / math.sqrt(5)).max() < 1e-11
        elif curve.kind == "adding-sliding":
            assert np.abs(push - np.abs(amplitude - 1)).max() < 1e-11
    top = math.hypot(1, 2.5 * math.tanh(math.pi / 4) + 0.5)
    wanted = [(0, 1), (1.4338290190161366, 2.4338290190161366), (0, top)]
    assert len(points) == 4
    for point in points:
        assert min(np.abs(np.abs(point) - one).max() for one in wanted) < 1e-9
    assert found["regions"][0.0, 3.2] == "+ -" and found["regions"][1.1, 1.0] == "+ s"


@pytest.mark.slow
def test_chaos_beyond_the_touch_grows_in_proportion():
    found = ran("belt")
    touch = found["touch"]
    assert touch.parameter == pytest.approx(1.707799714885060333, abs=1e-12)  # of the textbook
    widths = np.array([np.ptp(cloud) for cloud in found["clouds"]])
    beyond = touch.parameter - found["values"]
    assert widths[beyond < -1e-4].max() < 1e-7  # a stable orbit
    chosen = beyond > 4e-4
    assert np.all(widths[chosen] < 1.96 * beyond[chosen])  # 160 points of the chaos, by chance
    sizes = [np.ptp(found["strobe"](nu, 2000, 100)) for nu in found["values"][chosen][::6]]
    sizes = np.array(sizes) / beyond[chosen][::6]
    assert np.ptp(sizes) < 0.02 * sizes.mean()
    assert "chaos of size linear" in touch.far_side.verdict


def test_stommel_boxes_have_two_stable_states_between_the_folds():
    """By roots of the equilibrium's equation on both sides of T = S."""
    found = ran("stommel")
    for e in (0.7, 1.0, 1.3):
        flows = []
        for sign in (1.0, -1.0):
            f = lambda q, e=e, sign=sign: (0.3 + sign * q) * (3 / (1 + sign * q) - q) - e
            grid = np.linspace(0, sign * 3, 3001)
            values = np.array([f(q) for q in grid])
            changes = np.flatnonzero(values[1:] * values[:-1] < 0)
            flows += [brentq(f, grid[k], grid[k + 1], xtol=1e-14) for k in changes]
        own = sorted(at.point[0] - at.point[1] for at in found["branch"].at(e))
        np.testing.assert_allclose(own, sorted(flows), atol=1e-9)


@pytest.mark.slow
def test_the_cycle_of_the_hybrid_pendulum_is_that_of_a_run():
    orbit = ran("hybrid")["orbit"]
    run = ns.simulate(ran("hybrid")["pendulum"], orbit.start, 10 * orbit.period, tol=1e-12)
    np.testing.assert_allclose(run.x[-1], orbit.start, atol=1e-9)
    assert set(orbit.itinerary.split()) == {"+,q=-1", "+,q=1", "-,q=1", "-,q=-1"}


@pytest.mark.slow
def test_the_relay_slides_as_often_as_runs_do():
    """Runs beside two of its bifurcations, beyond their transients: slides in a period."""
    found = ran("relay")
    branch, relay = found["branch"], found["relay"]
    for event in branch.events[1:3]:
        for w in (event.parameter - 0.05, event.parameter + 0.05):
            orbit = branch[w]
            run = relay.run({"w": w}, t_end=60.0)
            late = [
                s for s in run.segments if s.mode == "s" and s.t_start > 60.0 - 4 * orbit.period
            ]
            long = [s.t_start for s in late if s.t_end - s.t_start > 1.0]
            once = [s for s in late if long[0] <= s.t_start < long[0] + orbit.period * (1 - 1e-9)]
            assert len(once) == sum(leg.mode == "s" for leg in orbit.legs)
    assert [e.kind for e in branch.events].count("grazing-sliding") == 6
    assert all("stable" in orbit.stability for orbit in branch.orbits)


@pytest.mark.slow
def test_the_walker_alternates_where_the_multiplier_of_its_step_is_minus_one():
    """By differences of simulated steps; between its first two doublings walks take the steps of the branch."""
    found = ran("walker")
    first, second = found["doublings"][:2]
    assert first == pytest.approx(0.0151, abs=5e-5)  # Garcia et al. 1998: "about 0.015"
    event = found["gaits"][1].events[0]
    middle = event.orbit.trajectory(event.orbit.trajectory.t[0] + 1.0)

    def step(change):
        """One second into a step, to one second into the next."""
        given = dict(parameters={"gamma": event.parameter}, tol=1e-13)
        strike = found["ns"].Section("heelstrike", count=1)
        at = found["ns"].simulate(found["system"], middle + change, 6.0, at=strike, **given).t[-1]
        return found["ns"].simulate(found["system"], middle + change, at + 1.0, **given).x[-1]

    slope = np.column_stack([(step(d) - step(-d)) / 2e-5 for d in 1e-5 * np.eye(4)])
    assert np.abs(np.linalg.eigvals(slope) + 1).min() < 1e-4
    alternating = found["gaits"][2]
    for slope, angles in zip(found["slopes"], found["walks"], strict=True):
        if slope < second - 2e-4:
            legs = [leg.start[0] for leg in alternating[float(slope)].legs]
            assert sorted({round(a, 6) for a in angles}) == sorted(round(a, 6) for a in legs)


@pytest.mark.slow
def test_the_oscillator_grazes_where_its_free_response_reaches_the_wall():
    found = ran("impact")
    size = math.hypot(1 - 2.2**2, 0.1 * 2.2)
    assert found["grazing"].parameter == pytest.approx(size, rel=1e-12)
    x, forces = found["many"].sample_x[..., 0], found["forces"]
    last = forces > 4.55
    truth = [found["strobed"](0)(found["single"][float(force)]) for force in forces[last]]
    assert np.abs(x[last] - np.array(truth)[:, None]).max() < 1e-6
    before = forces < 0.99 * size
    free = (forces / (1 - 2.2**2 + 0.22j)).real[before]
    assert np.abs(x[before] - free[:, None]).max() < 1e-6
