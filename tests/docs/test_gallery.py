"""Each program of the gallery runs, draws, and computes the numbers that its page speaks of.

The numbers come from outside the programs: closed forms, and the references of the textbook.
"""

import math
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.linalg import expm
from scipy.optimize import brentq

import nonsmooth as ns
from docs.tools import generate
from papers.pictures import illegible

#: The period of docs/examples/friction/stick_slip.py: both fields are linear, so the slip ends at a root of
#: a sum of exponentials, found here to 30 digits with mpmath.
PERIOD = 6.736837191765135


#: Programs that take seconds: they run among the slow tests.
DEAR = {
    *("atlas", "basins", "belt", "buck", "friction_drive", "harvest", "impact", "plane_friction"),
    *("hybrid", "pushed_block", "relay", "walker", "wells"),
    *("chatter", "conduction", "soft_impact", "synchrony"),
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
        assert illegible(figure) == []
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
    assert found["funnel"].t == pytest.approx(0.5, abs=1e-9)
    assert {d.side for d in found["funnel"].departures} == {"+", "-", "s"}


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
    exact = 1 + math.exp(zeta * math.pi / math.sqrt(1 - zeta**2))
    assert wells["threshold"] == pytest.approx(exact, abs=1e-7)
    labels, (xs, vs) = wells["found"].labels, wells["found"].axes.values()
    assert set(np.unique(labels)) == {1, 2}
    assert np.array_equal(labels, 3 - labels[::-1, ::-1])  # the system is odd
    row = labels[:, int(np.argmin(abs(vs)))]
    beyond = (xs > exact + 0.1) & (xs < 3.2)
    assert len(set(row[(xs > 0.2) & (xs < exact - 0.1)])) == 1
    assert set(row[beyond]).isdisjoint(row[(xs > 0.2) & (xs < exact - 0.1)])


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
                exact = found["amplitude"](W, friction)
                assert found["largest"](orbit) == pytest.approx(exact, rel=1e-10)
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
    expected = [(0, 1), (1.4338290190161366, 2.4338290190161366), (0, top)]
    assert len(points) == 4
    for point in points:
        assert min(np.abs(np.abs(point) - one).max() for one in expected) < 1e-9
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
    exact = [found["strobed"](0)(found["single"][float(force)]) for force in forces[last]]
    assert np.abs(x[last] - np.array(exact)[:, None]).max() < 1e-6
    before = forces < 0.99 * size
    free = (forces / (1 - 2.2**2 + 0.22j)).real[before]
    assert np.abs(x[before] - free[:, None]).max() < 1e-6


def oscillation(x, v, s, *, force, w, z, phase=0.0, stiffness=1.0, constant=0.0):
    """State at times s of x'' + 2 z x' + stiffness x = force cos(w s + phase) + constant, in closed form."""
    driven = force * np.exp(1j * phase) / (stiffness - w * w + 2j * z * w)
    rate = -z + 1j * math.sqrt(stiffness - z * z)
    y = x - driven.real - constant / stiffness
    free = y - 1j * (v - (1j * w * driven).real + z * y) / rate.imag
    turned, fallen = driven * np.expm1(1j * w * s), free * np.expm1(rate * s)
    return x + (turned + fallen).real, v + (1j * w * turned + rate * fallen).real


def first_zero(f, times):
    """The first root of f between neighbours of a grid of times, or None."""
    signs = np.sign(f(times))
    changes = np.flatnonzero(signs[1:] != signs[:-1])
    if not len(changes):
        return None
    a, b = times[changes[0]], times[changes[0] + 1]
    return brentq(f, a, b, xtol=1e-15, rtol=1e-14) if f(a) * f(b) < 0 else a  # a zero to rounding


def soft_periods(state, force, count):
    """A soft impact oscillator after so many periods of its force, arc by arc in closed form."""
    w, z, extra = 0.85, 0.1, 29.0
    (x, v), t, end, free = state, 0.0, 2 * math.pi * count / w, state[0] < 1
    while True:
        given = dict(force=force, w=w, z=z, phase=w * t)
        given |= {} if free else dict(stiffness=1 + extra, constant=extra)
        arc = lambda s, x=x, v=v, given=given: oscillation(x, v, s, **given)
        times = np.linspace(1e-6, end - t, 400 * count)
        s = first_zero(lambda s, arc=arc: arc(s)[0] - 1, times)
        if s is None:
            return np.array(arc(end - t))
        (x, v), t, free = arc(s), t + s, not free


@pytest.mark.slow
def test_the_soft_stop_doubles_where_its_closed_form_arcs_say():
    found = ran("soft_impact")
    kinds = [event.kind for event in found["single"].events]
    assert kinds == ["grazing of a soft switch", "period doubling"]
    touch = math.hypot(1 - 0.85**2, 2 * 0.1 * 0.85)
    assert found["single"].events[0].parameter == pytest.approx(touch, rel=1e-12)
    assert "+ -" in [orbit.itinerary for orbit in found["single"].solutions]
    seen = []
    for branch in ("single", "double", "four", "eight"):
        for event in found[branch].events:
            if event.kind != "period doubling":
                continue
            run, count = event.orbit.trajectory, round(event.orbit.period / found["period"])
            at = math.ceil(run.t[0] / found["period"]) * found["period"]
            start = run(at if at <= run.t[-1] else at - event.orbit.period)
            after = lambda x, A=event.parameter, count=count: soft_periods(x, A, count)
            assert np.abs(after(start) - start).max() < 1e-9
            step = 1e-7 * np.eye(2)
            slope = np.column_stack([(after(start + d) - after(start - d)) / 2e-7 for d in step])
            assert np.abs(np.linalg.eigvals(slope) + 1).min() < 1e-4
            seen.append(count)
    assert set(seen) == {1, 2, 4, 8}


def border_current(duty, K, C):
    """Current at the tick of a boost converter's orbit in continuous conduction, by matrix exponentials."""
    on = np.array([[0, 0, 1], [0, -K / (2 * C), 0], [0, 0, 0]])
    off = np.array([[0, -1, 1], [1 / C, -K / (2 * C), 0], [0, 0, 0]])
    period = expm((1 - duty) * off) @ expm(duty * on)
    return np.linalg.solve(np.eye(2) - period[:2, :2], period[:2, 2])[0]


@pytest.mark.slow
def test_the_converter_passes_into_discontinuous_conduction_at_the_border_of_the_textbook():
    found = ran("conduction")
    border = [brentq(lambda K, C=C: border_current(0.4, K, C), 0.12, 0.17) for C in (100.0, 1000.0)]
    assert found["border"].parameter == pytest.approx(border[0], abs=1e-11)
    errors = np.abs(np.array(border) - 0.4 * 0.6**2)
    assert errors[1] < 0.11 * errors[0] < 3e-6  # the formula is the limit of a large capacity
    for duty, K in found["curve"].values[::20]:
        assert abs(border_current(duty, K, 100.0)) < 1e-9
    branch = found["branch"]
    assert branch.values.min() == 0.02 and branch.values.max() == 0.3
    for K, itinerary in ((0.05, "+o +c -o"), (0.12, "+o +c -o"), (0.16, "+o -o"), (0.29, "+o -o")):
        orbit = branch[K]
        assert orbit.itinerary == itinerary
        assert found["mean"](orbit) == pytest.approx(float(found["ideal"](K)), rel=2e-4)


def bounces(force, state=(0.0, 0.0), restitution=0.6):
    """Impacts of one period from the lift, in closed form: their times after it, and that of the limit or None."""
    lift = -math.acos(1 / force)
    (x, v), t, times, grid = state, 0.0, [], np.linspace(0.3, 7.0, 2000)
    while True:
        given = dict(force=force, w=1.0, z=0.05, phase=t + lift, constant=-1.0)
        s = first_zero(lambda s, v=v, given=given: oscillation(x, v, s, **given)[0], grid)
        t, v = t + s, -restitution * oscillation(x, v, s, **given)[1]
        times.append(t)
        pull = 1 - force * math.cos(t + lift)  # on the stop, downwards
        if pull <= 0 or t > 2 * math.pi:
            return times, None
        rest = 2 * v / pull / (1 - restitution)
        if rest < 1e-6 * (2 * math.pi - t):
            return times, t + rest
        grid = np.geomspace(min(0.4 * v / pull, 0.1), 8.0, 2000)


@pytest.mark.slow
def test_chatter_and_its_end_are_those_of_closed_form_bounces():
    found = ran("chatter")
    for force in (1.1, 1.5, 1.9):
        orbit = found["complete"][force]
        (leg,) = [leg for leg in orbit.legs if leg.mode == "c"]
        assert bounces(force)[1] + leg.duration == pytest.approx(2 * math.pi, abs=1e-9)
        assert orbit.multipliers.tolist() == [0.0, 0.0]
    low, high = 1.9, 1.98
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if bounces(middle)[1] else (low, middle)
    end = found["end"]
    assert end.kind == "end of complete chatter"
    assert end.parameter == pytest.approx(low, abs=1e-7)
    distances = found["touches"] - low
    ratios = distances[:-1] / distances[1:]
    assert np.abs(ratios[:3] - 0.6).max() < 0.02 and np.all(np.diff(np.abs(ratios - 0.6)) > 0)


@pytest.mark.slow
def test_oscillators_stay_in_step_as_matrix_exponentials_say():
    found = ran("synchrony")
    orbit = found["orbit"]
    matrix = np.array([[-1.0, 0, 0], [1, -1, 0], [0, 1, -1]])
    slope = {"first lag to second": np.zeros((3, 3)), "second lag to first": np.zeros((3, 3))}
    slope["first lag to second"][1, 0] = slope["second lag to first"][0, 1] = 1.0

    def rate(name, kappa):
        product = np.eye(3)
        for leg, after in zip(orbit.legs, (*orbit.legs[1:], orbit.legs[0]), strict=True):
            jump = np.zeros((3, 3))
            jump[0, 2] = (2.0 if leg.mode == "+" else -2.0) / after.start[1]
            product = (
                (np.eye(3) + jump) @ expm((matrix - kappa * slope[name]) * leg.duration) @ product
            )
        return math.log(max(abs(np.linalg.eigvals(product)))) / orbit.period

    for name, curve in found["curves"].items():
        true = np.array([rate(name, kappa) for kappa in found["kappa"]])
        chosen = np.abs(found["kappa"] - 1) > 0.05  # two multipliers are equal near 1
        assert np.abs(curve - true)[chosen].max() < 1e-9
    for name, kappa, simulated in found["rates"]:
        assert simulated == pytest.approx(rate(name, kappa), abs=1e-4)
    assert brentq(lambda k: rate("first lag to second", k), 1.1, 1.5) == pytest.approx(
        1.28, abs=5e-3
    )
    assert brentq(lambda k: rate("second lag to first", k), 1.7, 2.1) == pytest.approx(
        1.874, abs=5e-3
    )
    for laplacian, eigenvalue in ((found["PAIR"], 2), (found["RING"], 3), (found["CHAIN"], 3)):
        for kappa, holds in ((1.2, True), (1.4, False)):
            coupling = found["COUPLINGS"]["first lag to second"]
            system = found["network"](laplacian, coupling)
            kick = 1e-4 * np.random.default_rng(0).standard_normal((3, len(laplacian)))
            start = np.array(orbit.start)[:, None] + kick
            run = ns.simulate(
                system, start.ravel(), 20 * orbit.period, parameters={"s": kappa / eigenvalue}
            )
            spread = np.ptp(run.x[-1].reshape(3, -1), axis=1).max()
            assert (spread < 1e-6) == holds and (spread > 1e-3) != holds
