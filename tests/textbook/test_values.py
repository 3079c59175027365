"""Every reference value of the textbook is computed to 1e-9 or to its own digits."""

import functools
import math

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

import nonsmooth as ns
from nonsmooth import textbook
from nonsmooth.model import motion
from tests.textbook import checks

TOL = 1e-13
CHECKS = {}


def check(name, *quantities):
    """Register a function (problem, reference) -> value for some quantities of a problem."""

    def register(function):
        for quantity in quantities:
            CHECKS[name, quantity] = function
        return function

    return register


@functools.cache
def build(name):
    return textbook.by_name(name)


@functools.cache
def run_of(name, at=(), t_end=None):
    return build(name).run(dict(at), t_end=t_end, tol=TOL)


def events(run, kind):
    return [event for event in run.events if event.kind == kind]


def moment(run, kind, k=0):
    """First state and time of an event."""
    event = events(run, kind)[k]
    return event.x[0], event.t


def segments(run, mode):
    """Complete segments of a mode: not the first, not the last of the run."""
    return [s for s in run.segments[1:-1] if s.mode == mode]


def evaluate(problem, expression, point, **at):
    return problem.system.evaluate(expression, point, {**problem.parameters, **at})


def sliding(problem, point, **at):
    return evaluate(problem, motion(problem.system, "s").field, point, **at).ravel()


def richardson(f, h):
    """Derivative at 0 by central differences of step h, h/2, h/4, extrapolated to order 6."""
    d = [(f(h / k) - f(-h / k)) * (k / (2 * h)) for k in (1, 2, 4)]
    e = [(4 * d[1] - d[0]) / 3, (4 * d[2] - d[1]) / 3]
    return (16 * e[1] - e[0]) / 15


# 1, 3, 11: friction -----------------------------------------------------------------------------


def lengths(name, mode):
    values = [s.t_end - s.t_start for s in segments(run_of(name), mode)]
    assert len(values) > 1 and np.ptp(values) < 1e-11
    return values[-1]


@check("leine_stick_slip", "slip time")
@check("stick_slip_exponential", "slip time")
def slip_time(problem, reference):
    return lengths(problem.name, "-")


@check("leine_stick_slip", "stick time")
def stick_time(problem, reference):
    return lengths(problem.name, "s")


@check("leine_stick_slip", "period")
@check("stick_slip_exponential", "period")
def exits_apart(problem, reference):
    a, b = events(run_of(problem.name), "exit")[-2:]
    return b.t - a.t


# 2, 4, 9, 10, 17: plane and line ----------------------------------------------------------------


@check("scalar_sliding", "alpha")
def scalar_alpha(problem, reference):
    l1, l2 = (evaluate(problem, problem.system.lie_derivative(m), [0.0]).item() for m in "+-")
    return l1 / (l1 - l2)


@check("scalar_repelling", "time of the status")
def repelled(problem, reference):
    run = run_of("scalar_repelling")
    assert run.status is ns.Status.NON_UNIQUE
    return run.t[-1]


@check("scalar_repelling", "x(1) leaving up", "x(1) leaving down")
def chosen(problem, reference):
    mode = "+" if "up" in reference.quantity else "-"
    return problem.run(start_mode=mode).x[-1, 0]


@check("planar_relay", "fold of F1", "fold of F2")
def relay_fold(problem, reference):
    lie = problem.system.lie_derivative("+" if reference.quantity.endswith("1") else "-")
    return brentq(lambda x: evaluate(problem, lie, [x, -x]).item(), -9.0, 9.0, xtol=1e-15)


@check("planar_relay", "x(2)")
def relay_slide(problem, reference):
    run = run_of("planar_relay")
    assert run.itinerary == "s"
    return run.x[-1, 0]


@check("planar_relay", "pseudo-node")
def relay_node(problem, reference):
    x = brentq(lambda x: sliding(problem, [x, -x])[0], -1.0, 1.5, xtol=1e-15)
    return x, -x


@check("planar_relay", "slope of the sliding field")
def relay_slope(problem, reference):
    return richardson(lambda x: sliding(problem, [x, -x])[0], 0.1)


@check("pseudo_hopf", "pseudo-node")
def hopf_node(problem, reference):
    return brentq(lambda x: sliding(problem, [x, 0.0])[0], -0.025, -0.005, xtol=1e-16)


# 5, 14, 15: several surfaces --------------------------------------------------------------------


@check("bouncing_ball", "Zeno time")
def limit(problem, reference):
    run = run_of(problem.name)
    assert run.status is ns.Status.ACCUMULATION
    return run.accumulation_time


@check("glass_loop", "crossing times 1 to 4")
def gene_switches(problem, reference):
    run = run_of("glass_loop")
    assert run.itinerary.startswith("++ +- -- -+ ++")
    return [e.t for e in run.events[:4]]


@check("ambiguous_exit", "exit time, bilinear")
def bilinear_exit(problem, reference):
    run = run_of("ambiguous_exit")
    assert run.itinerary == "ss +s"
    assert run.events[0].x == pytest.approx([0.0, 0.0, 2.0], abs=1e-12)
    return run.events[0].t


@check("ambiguous_exit", "exit times allowed")
def exits_allowed(problem, reference):
    """The motion of x3 alone at the two ends of Filippov's range, which is linear in x3."""
    x3 = ca.SX.sym("x3")

    def time(end):
        z = problem.system.extended_states[2]
        at = [
            ns.local.intersection_range(problem.system, [0, 0, v], z)[end] for v in (0.0, 1.0, 2.0)
        ]
        assert at[1] == pytest.approx((at[0] + at[2]) / 2, rel=1e-12)
        speed = at[0] + (at[2] - at[0]) / 2 * x3
        reduced = ns.FilippovSystem([x3], field=[speed], stops=[ns.Stop(x3 - 2)])
        return ns.simulate(reduced, [0.0], 5.0, tol=TOL).t[-1]

    return time(1), time(0)


@check("hidden_dynamics", "x2' off the surface")
def off_surface(problem, reference):
    values = {evaluate(problem, problem.system.field(m)[1], [0.0, 0.0]).item() for m in "+-"}
    (value,) = values
    return value


@check("hidden_dynamics", "x2' sliding, linear", "x2' sliding, nonlinear")
def hidden(problem, reference):
    run = textbook.hidden_dynamics(nonlinear="nonlinear" in reference.quantity).run(tol=TOL)
    assert run.itinerary == "s"
    return run.x[-1, 1]


# 6, 13, 16: impacts -----------------------------------------------------------------------------


@check("impact_oscillator", "grazing amplitude")
def grazing(problem, reference):
    c, w = problem.parameters["c"], problem.parameters["w"]
    gain = 1 / math.hypot(1 - w**2, c * w)

    def touches(amplitude):
        run = problem.run({"A": amplitude, "x": -amplitude * gain}, tol=TOL)
        return bool(events(run, "reset"))

    low, high = 0.36, 0.38
    assert not touches(low) and touches(high)
    while high - low > 1e-11:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if touches(middle) else (middle, high)
    return 0.5 * (low + high)


def bounce(reference):
    run = run_of("kelvin_voigt_bounce", tuple(reference.at.items()))
    assert run.status is ns.Status.STOPPED
    return run


@check("kelvin_voigt_bounce", "slip restarts")
def slipping(problem, reference):
    event = events(bounce(reference), "exit")[0]
    assert event.mode_after == "-"
    return event.t


@check("kelvin_voigt_bounce", "slip at separation", "slip at separation, fast spin")
def last_slip(problem, reference):
    run = bounce(reference)
    assert run.itinerary == ("+" if reference.at else "+ s -")
    return run.x[-1, 1] + run.x[-1, 4]


@check("kelvin_voigt_bounce", "critical spin")
def critical_spin(problem, reference):
    """The rolling motion, followed beyond its exits, must have A = 0 where the load vanishes."""
    p = problem.parameters

    def miss(spin):
        run = problem.run({**reference.at, "Omega": spin}, tol=TOL)
        entry = events(run, "entry")[0]
        roll = ns.flow.follow(
            problem.system, entry.x, 5.0, t_start=entry.t, mode="s", until="separation", tol=TOL
        )
        assert roll.status is ns.Status.STOPPED
        x = roll.x[-1]
        return 2 * p["d1"] * p["eta"] * x[1] + p["eta"] ** 2 * x[0]

    return brentq(miss, 0.4, 0.6, xtol=1e-14)


# 7, 8, 12: models -------------------------------------------------------------------------------


@check("harvested_prey_predator", "fold of F1", "fold of F2")
def harvest_fold(problem, reference):
    above = reference.quantity.endswith("1")
    lie = problem.system.lie_derivative("+" if above else "-")
    low, high = (0.5, 0.9) if above else (0.01, 0.2)
    alpha = problem.parameters["alpha"]
    return brentq(lambda x: evaluate(problem, lie, [x, alpha]).item(), low, high, xtol=1e-16)


@check("harvested_prey_predator", "boundary focus", "boundary node")
def harvest_boundary(problem, reference):
    mode = "-" if "focus" in reference.quantity else "+"
    start = (0.0428, 0.92) if mode == "-" else (0.72, 0.8)
    field = problem.system.field(mode)
    jacobian = ca.jacobian(field, problem.system.extended_states)
    x = np.array(start)
    for _ in range(20):
        x = x - np.linalg.solve(evaluate(problem, jacobian, x), evaluate(problem, field, x).ravel())
    eigenvalues = np.linalg.eigvals(evaluate(problem, jacobian, x))
    assert np.iscomplexobj(eigenvalues) == (mode == "-")
    return x[1]


@check("harvested_prey_predator", "pseudo-saddle-node")
def harvest_double_zero(problem, reference):
    """Largest alpha for which x1' = 0 has a solution on the surface: alpha as a function of x1."""

    def level(x):
        return brentq(lambda a: sliding(problem, [x, a], alpha=a)[0], 0.1, 3.0, xtol=1e-15)

    top = brentq(lambda x: richardson(lambda s: level(x + s), 1e-2), 0.2, 0.5, xtol=1e-12)
    return level(top)


@check("welander_box", "boundary equilibrium, k = 0", "boundary equilibrium, k = 5")
def welander_boundary(problem, reference):
    mode = "-" if reference.quantity.endswith("0") else "+"
    field = problem.system.field(mode)
    zero = np.zeros(2)
    jacobian = evaluate(problem, ca.jacobian(field, problem.system.extended_states), zero)
    x = np.linalg.solve(jacobian, -evaluate(problem, field, zero).ravel())
    return x[1] - problem.parameters["a"] * x[0]


@check("welander_box", "pseudo-equilibrium T")
def welander_rest(problem, reference):
    run = run_of("welander_box", tuple(reference.at.items()), 100.0)
    assert run.segments[-1].mode == "s"
    return run.x[-1, 0]


def jump_sensitivity(problem, name, component):
    base = {
        **problem.parameters,
        **dict(zip(problem.system.state_names, problem.start, strict=True)),
    }
    return richardson(lambda s: problem.run({name: base[name] + s}, tol=TOL).x[-1, component], 2e-2)


@check("state_dependent_jump", "dx1(20)/dx0", "dx2(20)/dx0")
def jump_initial(problem, reference):
    component = int(reference.quantity[2]) - 1
    return [jump_sensitivity(problem, name, component) for name in ("x1", "x2")]


@check("state_dependent_jump", "dx(20)/dp")
def jump_parameter(problem, reference):
    return [jump_sensitivity(problem, "p", component) for component in (0, 1)]


@check("two_fold", "trace", "determinant", "discriminant")
def two_fold_number(problem, reference):
    """From the linear sliding flow, scaled by z2 + z3, at two points."""
    points = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    matrix = np.array([sliding(problem, z)[1:] * (z[1] + z[2]) for z in points]).T
    trace, determinant = np.trace(matrix), np.linalg.det(matrix)
    return {"trace": trace, "determinant": determinant, "discriminant": trace**2 - 4 * determinant}[
        reference.quantity
    ]


# periodic orbits by their boundary value problem ---------------------------------------------------


@functools.cache
def orbit_of(name, at=()):
    problem = build(name)
    start, values = problem.start_at(dict(at))
    if name == "belt_oscillator":
        return ns.periodic_orbit(problem.system, start)
    if name == "simplest_walker":
        return ns.periodic_orbit(problem.system, start, itinerary=[("", "heelstrike")])
    if name == "buck_converter" and at:  # near its period doubling a run takes long to settle
        return ns.periodic_orbit(problem.system, orbit_of(name), parameters=values)
    odd = "odd" if name in ("multi_sliding_relay", "forced_dry_friction") else None
    return ns.periodic_orbit(problem.system, run_of(name, at), symmetry=odd)


def orbit_for(problem, reference):
    return orbit_of(problem.name, tuple(reference.at.items()))


@check("forced_dry_friction", "multiplier (re, im)")
@check("simplest_walker", "multiplier (re, im)")
@check("buck_converter", "multiplier (re, im)")
def complex_multiplier(problem, reference):
    (value,) = [m for m in orbit_for(problem, reference).multipliers if m.imag > 0]
    return value.real, value.imag


@check("block_on_disc", "friction on the disc")
def edge_of_riding(problem, reference):
    def rides(r):
        run = problem.run({"x1": r, "v1": 0.0, "v2": r}, t_end=1e-3)
        return 1.0 if run.itinerary == "s" else -1.0

    return brentq(rides, 0.3, 0.7, xtol=1e-10)


@check("turntable", "period")
def circle(problem, reference):
    run = run_of(problem.name)
    start, guess = np.array(problem.start), reference.value
    return brentq(lambda t: (run(t) - start)[0], guess - 0.5, guess + 0.5, xtol=1e-14)


@check("turntable", "opposite point (x1, x2)")
def opposite(problem, reference):
    return run_of(problem.name)(problem["period"].value / 2)[:2]


@check("shaken_block", "slip in the end")
def shaken_slip(problem, reference):
    run, angle = run_of(problem.name), 2.0 * problem.t_end
    return np.linalg.norm(run.x[-1, 2:] - [math.cos(angle), math.sin(angle)])


@check("shaken_block", "least friction that holds")
def friction_that_holds(problem, reference):
    def holds(mu_g):
        run = problem.run({"v1": 1.0, "mu_g": mu_g}, t_end=1e-3)
        return 1.0 if run.itinerary == "s" else -1.0

    return brentq(holds, 1.5, 2.5, xtol=1e-10)


# values read off a run, a settled cycle or a periodic orbit ---------------------------------------

OF_RUN = {
    ("dry_friction", "rest (y1, t)"): lambda run: moment(run, "entry"),
    **{
        ("dry_friction", f"turn {k + 1} (y1, t)"): lambda run, k=k: moment(run, "crossing", k)
        for k in range(3)
    },
    **{
        name: lambda run: moment(run, "entry")[1]
        for name in (
            ("block_on_incline", "rest (t)"),
            ("block_on_disc", "sticks (t)"),
            ("cue_ball", "rolls (t)"),
            ("pivoting_disc", "rest (t)"),
        )
    },
    ("block_on_belt", "carried away (x1, x2, t)"): lambda run: (
        *events(run, "entry")[0].x[:2],
        events(run, "entry")[0].t,
    ),
    ("two_relay_spiral", "time of rest"): lambda run: moment(run, "rest")[1],
    ("dry_friction", "end y1"): lambda run: run.x[-1, 0],
    ("leine_stick_slip", "x at re-stick"): lambda run: events(run, "entry")[-1].x[0],
    ("stick_slip_exponential", "landing x1"): lambda run: events(run, "entry")[-1].x[0],
    ("stick_slip_exponential", "exit (x1, x2)"): lambda run: events(run, "exit")[-1].x,
    ("spiral_oscillator", "crossing time"): lambda run: run.events[0].t,
    ("spiral_oscillator", "crossing state"): lambda run: run.events[0].x,
    ("spiral_oscillator", "state at pi/2"): lambda run: run.x[-1],
    ("scalar_sliding", "switch time"): lambda run: events(run, "entry")[0].t,
    ("scalar_sliding", "end"): lambda run: run.x[-1, 0],
    ("two_relay_spiral", "switch times 1 to 4"): lambda run: [e.t for e in run.events[:4]],
    ("glass_loop", "distance at crossing 4"): lambda run: np.abs(run.events[3].x - 0.5).sum(),
    ("bouncing_ball", "first impact"): lambda run: run.events[0].t,
    ("state_dependent_jump", "switch times"): lambda run: [e.t for e in events(run, "crossing")],
    ("state_dependent_jump", "x(20)"): lambda run: run.x[-1],
    ("block_on_incline", "rest (x1, x2)"): lambda run: run.x[-1, :2],
    ("block_on_belt", "end (x1, x2)"): lambda run: run.x[-1, :2],
    ("block_on_belt", "halfway (x1, x2)"): lambda run: run(2.0)[:2],
    ("block_on_disc", "end (x1, x2)"): lambda run: run.x[-1, :2],
    ("cue_ball", "rolls (x1, x2)"): lambda run: events(run, "entry")[0].x[:2],
    ("cue_ball", "rolls (v1, v2)"): lambda run: run.x[-1, 2:4],
    ("pivoting_disc", "rest (x1, x2, phi)"): lambda run: run.x[-1, :3],
    ("shaken_block", "speed in the end"): lambda run: np.linalg.norm(run.x[-1, 2:]),
}
OF_BOUNCE = {
    ("kelvin_voigt_bounce", "separation time"): lambda run: run.t[-1],
    ("kelvin_voigt_bounce", "Y' at separation"): lambda run: run.x[-1, 3],
    ("kelvin_voigt_bounce", "sticking time"): lambda run: events(run, "entry")[0].t,
}
OF_ORBIT = {
    ("pseudo_hopf", "x0"): lambda orbit: max(-leg.start[0] for leg in orbit.legs),
    ("piecewise_cycle", "radius"): lambda orbit: np.linalg.norm(orbit.start),
    ("leine_stick_slip", "multipliers"): lambda orbit: orbit.multipliers.real,
    ("stick_slip_exponential", "multipliers"): lambda orbit: orbit.multipliers.real,
    ("multi_sliding_relay", "period"): lambda orbit: orbit.period,
    ("simplest_walker", "long step"): lambda orbit: orbit.period,
    ("simplest_walker", "short step"): lambda orbit: orbit.period,
    ("multi_sliding_relay", "multiplier"): lambda orbit: orbit.multipliers[1].real,
    ("simplest_walker", "multiplier of short steps"): lambda orbit: orbit.multipliers[1].real,
    ("buck_converter", "multiplier at the period doubling"): lambda orbit: (
        orbit.multipliers[1].real
    ),
    ("forced_dry_friction", "multiplier"): lambda orbit: orbit.multipliers[0].real,
    ("belt_oscillator", "multipliers"): lambda orbit: orbit.multipliers.real,
    ("forced_dry_friction", "turning point"): lambda orbit: max(leg.start[0] for leg in orbit.legs),
    ("forced_dry_friction", "stick time"): lambda orbit: next(
        leg.duration for leg in orbit.legs if leg.mode == "s"
    ),
}


for _name in ("pseudo_hopf", "piecewise_cycle", "welander_box"):
    OF_ORBIT[_name, "period"] = lambda orbit: orbit.period
    OF_ORBIT[_name, "multiplier"] = lambda orbit: orbit.multipliers[1].real


def read_off(values, source):
    for key, value in values.items():
        CHECKS[key] = lambda problem, reference, value=value: value(*source(problem, reference))


read_off(OF_RUN, lambda problem, _: (run_of(problem.name),))
read_off(OF_BOUNCE, lambda _, reference: (bounce(reference),))
read_off(OF_ORBIT, lambda problem, reference: (orbit_for(problem, reference),))


CHECKS |= checks.CHECKS

ALL = [(name, r) for name, make in textbook.PROBLEMS.items() for r in make().references]


@pytest.mark.parametrize(("name", "reference"), ALL, ids=lambda v: getattr(v, "quantity", v))
def test_reference(name, reference):
    computed = CHECKS[name, reference.quantity](build(name), reference)
    assert reference.agrees(computed), (
        f"{reference}: computed {computed}, {reference.error(computed):.2e}"
    )


def test_every_check_belongs_to_a_reference():
    assert set(CHECKS) == {(name, r.quantity) for name, r in ALL}


def test_hidden_dynamics_are_refused_unless_meant():
    x, lam = ca.SX.sym("x"), ca.SX.sym("lam")
    with pytest.raises(ns.DefinitionError, match=r"multiplier lam.*linear"):
        ns.FilippovSystem([x], surface=x, multipliers=lam, field=[0.2 - lam**3])
