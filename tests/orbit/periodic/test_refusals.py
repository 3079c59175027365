"""What cannot be a periodic orbit is refused with the leg, what happened and what to try."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.periodic.boundary_value_problem import BoundaryProblem
from tests.orbit.periodic_cases import forced_friction, scalar_relay, stick_slip, walker, welander

X, Y = ca.SX.sym("x"), ca.SX.sym("y")
EARLY = r"guess.*leg 2 \(s, ended by lambda0 = 1\)"
NO_FRICTION = {"parameters": {"f": 0.0}}
AT_PASSENGER = [-6.386823184357734, 0.0, -0.15958604063869292, -0.018239069591006747]


def damped():
    return ns.FilippovSystem([X, Y], field=[Y, -X - Y / 2])


def with_an_unstable_passenger():
    z, w = ca.SX.sym("z"), ca.SX.sym("w")
    above, below = ([Y, s - X - Y / 5, X - 40 * z, 20 * w + Y] for s in (1, -1))
    return ns.FilippovSystem([X, Y, z, w], surface=Y, above=above, below=below)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(
    ("build", "guess", "options", "error", "message"),
    [
        (forced_friction, [1.5, 0.0], {"period": -2.0}, ns.OptionError, "period"),
        (forced_friction, [1.5, 0.0], {"period": 3.3}, ns.OptionError, "period.*3.3"),
        (forced_friction, [1.5, 0.0], {"period": "x"}, ns.OptionError, "period.*'x'"),
        (walker, [0.2, -0.2, 0.4, -0.0158], {"itinerary": [("", "toe")]}, ns.OptionError, "itinerary.*'toe'"),
        (welander, [0.4, 0.3], {"max_iterations": 0}, ns.OptionError, "max_iterations"),
        (damped, [1.0, 0.0], {}, ns.ConvergenceError, "shrank.*equilibrium"),
        (stick_slip, [1.0, 0.5], {"itinerary": "- s +"}, ns.ConvergenceError, EARLY),
        (with_an_unstable_passenger, AT_PASSENGER, {}, ns.ConvergenceError, r"grow by 3e\+27 .*itinerary="),
        (stick_slip, [1.0, 0.5], {"itinerary": "- s", **NO_FRICTION}, ns.DegenerateError, "leg 2.*two-fold"),
    ],
)  # fmt: skip
def test_errors_name_the_leg_and_the_cause(build, guess, options, error, message) -> None:
    with pytest.raises(error, match=message):
        ns.periodic_orbit(build(), guess, **options)


@pytest.mark.parametrize("start", [1e6, 1e8, 1e10, 1e14])
def test_trial_steps_may_overflow(start) -> None:
    """So far away the orbit is found by chance, or an error of the library says that it is not."""
    near = ns.periodic_orbit(stick_slip(), [1.0, 0.5], itinerary="- s")
    try:
        far = ns.periodic_orbit(stick_slip(), [start, 0.5], itinerary="- s")
    except ns.ConvergenceError:
        assert start > 1e6
    else:
        assert far.period == pytest.approx(near.period, rel=1e-12)


def test_an_unknown_section_raises() -> None:
    with pytest.raises(ns.OptionError, match="'h7'"):
        ns.orbit.poincare(forced_friction(), "h7", [1.0, 0.0], count=3)


@pytest.mark.parametrize("word", [3, [("-", "h0", "entry")], [3], [("-", 2)], [[]], [None]])
def test_invalid_itineraries_raise(word) -> None:
    with pytest.raises(ns.OptionError, match="itinerary"):
        ns.periodic_orbit(stick_slip(), [1.0, 0.5], itinerary=word)


@pytest.mark.parametrize(
    ("names", "bounds", "error", "message"),
    [
        (None, [(1, 3), (0.5, 2)], ns.DefinitionError, "parameters"),
        (3, [(1, 3), (0.5, 2)], ns.DefinitionError, "parameters"),
        (("A", "k", "A"), [(1, 3), (0.5, 2)], ns.DefinitionError, "parameters"),
        (("A", "k"), None, ns.OptionError, "bounds"),
        (("A", "k"), 3.0, ns.OptionError, "bounds"),
    ],
)
def test_invalid_parameters_and_bounds_of_a_bifurcation_raise(
    names, bounds, error, message
) -> None:
    branch = ns.continue_orbit(ns.periodic_orbit(scalar_relay(), [0.5]), "A", bounds=(1.5, 3.0))
    with pytest.raises(error, match=message):
        ns.continue_bifurcation(branch.events[0], names, bounds=bounds)


@pytest.mark.parametrize("points", [3, [[0.0]], [[float("nan"), 0.0]], [[[0.0, 1.0, 2.0]]]])
def test_invalid_attractors_raise(points) -> None:
    grid = {"x": [0.0, 1.0], "v": 0.0}
    with pytest.raises(ns.PointError, match="attractors"):
        ns.basins(stick_slip(), grid, t_end=10.0, attractors=points)


@pytest.mark.parametrize("start", [1e300, -1e17])
def test_a_state_whose_motion_is_lost_in_rounding_is_no_orbit(start) -> None:
    with pytest.raises(ns.ConvergenceError, match="rounding"):
        ns.periodic_orbit(scalar_relay(), [start])


@pytest.mark.parametrize("offset", [1e6, 1e9])
def test_an_orbit_far_from_the_origin_is_one_as_long_as_it_moves(offset) -> None:
    """The relay of the docstring about x = offset: its multiplier is that of offset 0."""
    t = ca.SX.sym("t")
    drive = 2.5 * ca.cos(t)
    relay = ns.FilippovSystem([X], surface=X - offset, above=[drive - 1], below=[drive + 1], time=t)
    orbit = ns.periodic_orbit(relay, [offset + 0.5])
    c = 2.5 * (1 - (ca.pi / 5) ** 2) ** 0.5
    assert abs(orbit.multipliers[0] - ((c - 1) / (c + 1)) ** 2) < 1e-15 * offset


def test_an_equilibrium_of_a_forced_system_is_an_orbit_though_it_does_not_move() -> None:
    """x' = (0.1 - x)(2 + cos t): the multiplier of x = 0.1 is exp(-4 pi)."""
    t = ca.SX.sym("t")
    system = ns.FilippovSystem([X], field=[(0.1 - X) * (2 + ca.cos(t))], time=t)
    orbit = ns.periodic_orbit(system, ns.simulate(system, [0.3], t_end=40.0))
    assert orbit.start == pytest.approx([0.1], rel=1e-15)
    assert abs(orbit.multipliers[0].real / ca.exp(-4 * ca.pi) - 1) < 1e-8


def integrators(b3: float, a: float) -> ns.FilippovSystem:
    """Three integrators with a relay that its output lags by two: fast switches (Johansson et al. 1999)."""
    z = ca.SX.sym("z")
    field = lambda u: [Y - a * X, z - u - a * X, -b3 * u - a * X]
    return ns.FilippovSystem([X, Y, z], surface=X, above=field(1), below=field(-1))


@pytest.mark.slow
def test_a_run_that_chatters_raises() -> None:
    system = integrators(0.1, 1.0)
    run = ns.simulate(system, [1.0, 0.0, 0.0], 200.0, max_events=20_000)
    assert run.status is ns.Status.TOO_MANY_EVENTS
    with pytest.raises(ns.ConvergenceError, match=r"guess.*TOO_MANY_EVENTS"):
        ns.periodic_orbit(system, run)
    with pytest.raises(ns.ConvergenceError, match=r"guess.*chatters"):  # 2,000 events of its own
        ns.periodic_orbit(integrators(0.0, 1.0), [1.0, 0.0, 0.0])


@pytest.mark.parametrize("start", [[1.0, 0.0, 0.0], [0.3, -0.2, 0.5]])
def test_an_orbit_that_shrinks_to_a_two_fold_raises(start) -> None:
    """Near x = y = 0 small orbits nearly close, by their size squared: Newton's method halves them."""
    with pytest.raises(ns.ConvergenceError, match="shrank"):
        ns.periodic_orbit(integrators(1.0, 0.0), start)


def harmonic() -> ns.FilippovSystem:
    """Orbits of period 2 pi around a circle that attracts."""
    pull = 1 - X**2 - Y**2
    return ns.FilippovSystem([X, Y], field=[-Y + X * pull, X + Y * pull])


def test_the_period_option_of_an_autonomous_system_is_approximate() -> None:
    system = harmonic()
    run = ns.simulate(system, [0.5, 0.0], t_end=60.0)
    for guess in (run, [0.5, 0.0], ns.periodic_orbit(system, run)):
        assert ns.periodic_orbit(system, guess, period=7.0).period == pytest.approx(2 * ca.pi)
        with pytest.raises(ns.ConvergenceError, match=r"period = 12.5664.*6.2831"):
            ns.periodic_orbit(system, guess, period=4 * ca.pi)
    odd = ns.periodic_orbit(system, run, period=6.0, symmetry="odd")
    assert odd.symmetric and odd.period == pytest.approx(2 * ca.pi)


@pytest.mark.parametrize("period", [-1.0, 0.0, float("nan"), "x", X])
def test_invalid_periods_of_an_autonomous_system_raise(period) -> None:
    with pytest.raises(ns.OptionError, match="period"):
        ns.periodic_orbit(harmonic(), [0.5, 0.0], period=period)


def test_options_that_an_orbit_or_a_run_fixes_raise() -> None:
    system = scalar_relay()
    orbit = ns.periodic_orbit(system, [0.5])
    for options, message in [
        ({"itinerary": "+ -"}, "itinerary"),
        ({"t_start": 1.0}, "t_start"),
        ({"period": 3.0}, "period"),
        ({"symmetry": "odd"}, "symmetry"),
    ]:
        with pytest.raises(ns.OptionError, match=message):
            ns.periodic_orbit(system, orbit, **options)
    with pytest.raises(ns.OptionError, match="itinerary"):
        ns.periodic_orbit(system, ns.simulate(system, [0.5], 40.0), itinerary="+ -")


@pytest.mark.parametrize("times", [2, 3, 10])
def test_a_multiple_of_the_forcing_period_gives_the_prime_period(times) -> None:
    once = ns.periodic_orbit(scalar_relay(), [0.5])
    several = ns.periodic_orbit(scalar_relay(), [0.5], period=2 * ca.pi * times)
    assert several.period == pytest.approx(once.period) and len(several.legs) == 2
    assert abs(several.multipliers[0] - once.multipliers[0]) < 1e-12


def test_a_leg_that_begins_near_zero_may_take_as_long_as_the_one_before() -> None:
    """At its events the only state of a relay is zero, which says nothing of how long a leg takes."""
    found = ns.periodic_orbit(scalar_relay(), [0.5], itinerary="+ -")
    assert (
        abs(found.multipliers[0] - ns.periodic_orbit(scalar_relay(), [0.5]).multipliers[0]) < 1e-13
    )


def test_an_orbit_of_a_similar_system_is_a_guess() -> None:
    orbit = ns.periodic_orbit(scalar_relay(), [0.5])
    for guess in (orbit, ns.simulate(scalar_relay(), [0.5], 40.0)):
        with pytest.raises(ns.DefinitionError, match="guess"):
            ns.periodic_orbit(harmonic(), guess)
    t, a, k = (ca.SX.sym(name) for name in ("t", "A", "k"))
    drive = a * ca.cos(t) - X / 10  # a friction more
    names = {a: 2.5, k: 1.0}
    like = ns.FilippovSystem(
        [X], surface=X, above=[drive - k], below=[drive + k], time=t, parameters=names
    )
    known = ns.periodic_orbit(like, [0.5])
    found = ns.periodic_orbit(like, orbit)
    assert found.system is like
    assert found.multipliers[0] == pytest.approx(known.multipliers[0], rel=1e-12)


@pytest.mark.parametrize("cost", [ca.log(X - 100), ca.sqrt(X)])
def test_a_cost_that_is_not_finite_raises(cost) -> None:
    """The logarithm of a negative number; a root of zero, whose slope is infinite."""
    run = ns.simulate(ns.FilippovSystem([X], field=[-X]), [0.0], 1.0)
    with pytest.raises(ns.DegenerateError, match="cost"):
        ns.gradient(run, cost)


def test_invalid_numbers_of_returns_raise() -> None:
    system = scalar_relay()
    hits = ns.orbit.poincare(system, "h0", [0.5], count=3, direction=0)
    for options in ({"k": 1.5}, {"k": "a"}, {"k": 1, "since": "a"}, {"k": 1, "since": -2}):
        with pytest.raises(ns.OptionError, match=r"\b(k|since)\b"):
            hits.jacobian(**options)
    with pytest.raises(ns.OptionError, match="t_start"):
        ns.orbit.poincare(system, 1.0, [0.5], count=3, t_start="a")


@pytest.mark.parametrize("step", [2.0, 1e9])
def test_steps_are_no_longer_than_the_bounds_are_wide(step) -> None:
    orbit = ns.periodic_orbit(scalar_relay(), [0.5])
    branch = ns.continue_orbit(orbit, "A", bounds=(1.5, 3.0), step=step)
    assert [event.kind for event in branch.events] == ["crossing-sliding"]
    assert branch.events[0].parameter == pytest.approx((1 + ca.pi**2 / 4) ** 0.5, rel=1e-12)


class Circle(ns.continuation.Curve):
    """The unit circle."""

    def equations(self, u):
        return np.array([u @ u - 1.0]), 2 * u[None, :]


def curve(**given):
    return type("Mine", (Circle,), given)()


CURVES = [
    ({"equations": lambda self, u: None}, "curve.equations"),
    ({"equations": lambda self, u: u @ u}, "curve.equations"),
    ({"equations": lambda self, u: (u, np.eye(2))}, r"curve.equations.*\(1, 2\)"),
    ({"parameter": 7}, "curve.parameter"),
    ({"scale": np.array([1.0, 0.0])}, "curve.scale"),
    ({"tests": lambda self, point: [0.5]}, r"curve.tests.*\[0.5\]"),
    ({"tests": lambda self, point: {"half": "a"}}, "curve.tests.*'half'"),
    ({"tests": lambda self, point: {3: 0.5}, "exact": False}, "curve.tests.*3"),
    ({"tests": lambda self, point: {"x": point.u}}, "under"),
]


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"curve": None}, ns.DefinitionError, "curve"),
        ({"curve": Circle}, ns.DefinitionError, "curve"),
        ({"curve": ns.continuation.Curve()}, ns.DefinitionError, "curve.*equations"),
        *(({"curve": curve(**own)}, ns.DefinitionError, words) for own, words in CURVES),
        ({"rows": []}, ns.PointError, "rows"),
        ({"rows": None}, ns.PointError, "rows"),
        ({"rows": ["ab"]}, ns.PointError, "rows"),
        ({"rows": [[1.0, 0.0], [1.0]]}, ns.PointError, "rows"),
        ({"rows": [[float("nan"), 0.0]]}, ns.PointError, "rows.*finite"),
        ({"tangent": [1.0]}, ns.PointError, "tangent"),
        ({"tangent": [0.0, 0.0]}, ns.PointError, "tangent"),
        ({"step": 0.0}, ns.OptionError, "step"),
        ({"step": float("nan")}, ns.OptionError, "step"),
        ({"step": "a"}, ns.OptionError, "step"),
        ({"first": -1.0}, ns.OptionError, "first"),
        ({"most": 0}, ns.OptionError, "most"),
        ({"bounds": 3}, ns.OptionError, "bounds"),
        ({"bounds": [(5, 0, 1)]}, ns.OptionError, "bounds"),
        ({"bounds": [(0, 2, 1)]}, ns.OptionError, "bounds"),
        ({"bounds": [(0, float("nan"), 1)]}, ns.OptionError, "bounds"),
        ({"report": 3}, ns.OptionError, "report"),
    ],
)
def test_invalid_curves_raise(change, error, message) -> None:
    given = {"curve": Circle(), "rows": [[1.0, 0.0]], "tangent": [0.0, 1.0], "step": 0.2} | change
    with pytest.raises(error, match=message):
        ns.continuation.trace(given.pop("curve"), given.pop("rows"), given.pop("tangent"), **given)


def test_invalid_arguments_of_continuation_raise() -> None:
    c, u = ns.continuation, np.array([1.0, 0.0])
    for call, error in [
        (lambda: c.directions(None, u), ns.DefinitionError),
        (lambda: c.directions(Circle(), None), ns.PointError),
        (lambda: c.depart(None, u, u, 0.1, u), ns.DefinitionError),
        (lambda: c.other_direction(None), ns.DefinitionError),
        (lambda: c.ahead([], 0.1, u), ns.PointError),
        (lambda: list(c.pieces(None, None, None, last=None)), ns.DefinitionError),
        (lambda: c.converge(None, u), ns.DefinitionError),
        (lambda: c.converge(lambda v: (v, np.eye(2)), "a"), ns.PointError),
    ]:
        with pytest.raises(error, match="expected"):
            call()


def test_a_guess_of_many_periods_is_solved_for_the_prime_period(monkeypatch) -> None:
    solved, evaluate = [], BoundaryProblem.evaluate

    def counted(problem, *rest, **more):
        solved.append(len(problem.legs))
        return evaluate(problem, *rest, **more)

    monkeypatch.setattr(BoundaryProblem, "evaluate", counted)
    orbit = ns.periodic_orbit(scalar_relay(), [0.5], period=200 * 2 * np.pi)
    assert max(solved) == len(orbit.legs) == 2
    assert orbit.period == pytest.approx(2 * np.pi, rel=1e-14)


@pytest.mark.slow
def test_a_guess_of_two_thousand_legs_is_refused_without_their_singular_values() -> None:
    """They took more than four minutes in one call, which no Ctrl-C ended."""
    with pytest.raises(ns.ConvergenceError, match=r"\.\.\. \(\d+ legs\)") as caught:
        ns.periodic_orbit(scalar_relay(), [0.5], period=1000 * 2 * np.pi)
    assert len(str(caught.value)) < 600
