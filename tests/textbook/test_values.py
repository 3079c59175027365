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

TOL = 1e-13


@functools.cache
def build(name):
    return textbook.by_name(name)


@functools.cache
def run_of(name, at, t_end):
    return build(name).run(dict(at), t_end=t_end, tol=TOL)


@functools.cache
def orbit_of(name, at):
    problem = build(name)
    start, values = problem.start_at(dict(at))
    if name in ("belt_oscillator", "soft_stop"):
        forcing = {"period": 2 * np.pi / 0.8} if name == "soft_stop" else {}
        return ns.periodic_orbit(problem.system, start, **forcing)
    if name == "simplest_walker":
        return ns.periodic_orbit(problem.system, start, itinerary=[("", "heelstrike")])
    if name == "buck_converter" and at:  # near its period doubling a run takes long to settle
        return ns.periodic_orbit(problem.system, orbit_of(name, ()), parameters=values)
    odd = "odd" if name in ("multi_sliding_relay", "forced_dry_friction") else None
    run = run_of(name, at, 400.0 if name == "boost_converter" else None)
    return ns.periodic_orbit(problem.system, run, symmetry=odd)


class Of:
    """A problem with what is computed of it, at the values of a reference."""

    def __init__(self, name, reference):
        self.name, self.problem, self.quantity = name, build(name), reference.quantity
        self.system, self.at, self.known = self.problem.system, dict(reference.at), reference.value
        self.parameters = {**self.problem.parameters, **self.at}

    def run(self, t_end=None):
        return run_of(self.name, tuple(self.at.items()), t_end)

    @property
    def end(self):
        return self.run().x[-1]

    @property
    def orbit(self):
        return orbit_of(self.name, tuple(self.at.items()))

    @property
    def multiplier(self):
        return self.orbit.multipliers[1].real

    @property
    def pair(self):
        (value,) = [m for m in self.orbit.multipliers if m.imag > 0]
        return value.real, value.imag

    def events(self, *kinds):
        return [event for event in self.run().events if event.kind in kinds or event.name in kinds]

    def times(self, *kinds):
        return [event.t for event in self.events(*kinds)]

    def length(self, mode):
        """Of complete segments of a mode: not the first, not the last of the run."""
        values = [s.t_end - s.t_start for s in self.run().segments[1:-1] if s.mode == mode]
        assert len(values) > 1 and np.ptp(values) < 1e-11
        return values[-1]

    def evaluate(self, expression, point, **at):
        return self.system.evaluate(expression, point, {**self.problem.parameters, **at})

    def rate(self, mode, point):
        return self.evaluate(self.system.lie_derivative(mode), point).item()

    def sliding(self, point, **at):
        return self.evaluate(motion(self.system, "s").field, point, **at).ravel()

    def equilibrium(self, near, **mode):
        return ns.find_equilibrium(self.system, near, **mode)

    def branch(self, start, name, bounds, **options):
        return ns.continue_equilibrium(
            self.system, start, name, bounds=bounds, side="+", **options
        ).events


def richardson(f, h):
    """Derivative at 0 by central differences of step h, h/2, h/4, extrapolated to order 6."""
    d = [(f(h / k) - f(-h / k)) * (k / (2 * h)) for k in (1, 2, 4)]
    e = [(4 * d[1] - d[0]) / 3, (4 * d[2] - d[1]) / 3]
    return (16 * e[1] - e[0]) / 15


def switch(of, name, t_end, low, high, holds, xtol=1e-10):
    """The value at which short runs begin or cease to hold."""

    def sign(value):
        run = of.problem.run({**of.at, **name(value)}, t_end=t_end)
        return 1.0 if holds(run) else -1.0

    return brentq(sign, low, high, xtol=xtol)


# those that take more than an expression ----------------------------------------------------------


def repelled(of):
    assert of.run().status is ns.Status.NON_UNIQUE
    return of.run().t[-1]


def limit(of):
    assert of.run().status is ns.Status.ACCUMULATION
    return of.run().accumulation_time


def gene_switches(of):
    assert of.run().itinerary.startswith("++ +- -- -+ ++")
    return [e.t for e in of.run().events[:4]]


def bilinear_exit(of):
    assert of.run().itinerary == "ss +s"
    assert of.run().events[0].x == pytest.approx([0.0, 0.0, 2.0], abs=1e-12)
    return of.run().events[0].t


def exits_allowed(of):
    """The motion of x3 alone at the two ends of Filippov's range, which is linear in x3."""
    x3, z = ca.SX.sym("x3"), of.system.extended_states[2]

    def time(end):
        at = [ns.local.intersection_range(of.system, [0, 0, v], z)[end] for v in (0.0, 1.0, 2.0)]
        assert at[1] == pytest.approx((at[0] + at[2]) / 2, rel=1e-12)
        speed = at[0] + (at[2] - at[0]) / 2 * x3
        reduced = ns.FilippovSystem([x3], field=[speed], stops=[ns.Stop(x3 - 2)])
        return ns.simulate(reduced, [0.0], 5.0, tol=TOL).t[-1]

    return time(1), time(0)


def off_surface(of):
    (value,) = {of.evaluate(of.system.field(m)[1], [0.0, 0.0]).item() for m in "+-"}
    return value


def hidden(of):
    run = textbook.hidden_dynamics(nonlinear="nonlinear" in of.quantity).run(tol=TOL)
    assert run.itinerary == "s"
    return run.x[-1, 1]


def grazing(of):
    c, w = of.parameters["c"], of.parameters["w"]
    gain = 1 / math.hypot(1 - w**2, c * w)

    def touches(amplitude):
        run = of.problem.run({"A": amplitude, "x": -amplitude * gain}, tol=TOL)
        return 1.0 if any(event.kind == "reset" for event in run.events) else -1.0

    return brentq(touches, 0.36, 0.38, xtol=1e-11)


def bounce(of):
    assert of.run().status is ns.Status.STOPPED
    return of.run()


def slipping(of):
    (event,) = of.events("exit")
    assert event.mode_after == "-"
    return event.t


def last_slip(of):
    assert bounce(of).itinerary == ("+" if of.at else "+ s -")
    return of.end[1] + of.end[4]


def critical_spin(of):
    """The rolling motion, followed beyond its exits, must have A = 0 where the load vanishes."""
    p = of.parameters

    def miss(spin):
        run = of.problem.run({**of.at, "Omega": spin}, tol=TOL)
        entry = next(event for event in run.events if event.kind == "entry")
        roll = ns.flow.follow(
            of.system, entry.x, 5.0, t_start=entry.t, mode="s", until="separation", tol=TOL
        )
        assert roll.status is ns.Status.STOPPED
        x = roll.x[-1]
        return 2 * p["d1"] * p["eta"] * x[1] + p["eta"] ** 2 * x[0]

    return brentq(miss, 0.4, 0.6, xtol=1e-14)


def harvest_fold(of):
    side, low, high = ("+", 0.5, 0.9) if of.quantity.endswith("1") else ("-", 0.01, 0.2)
    return brentq(lambda x: of.rate(side, [x, of.parameters["alpha"]]), low, high, xtol=1e-16)


def harvest_boundary(of):
    mode, x = ("-", (0.0428, 0.92)) if "focus" in of.quantity else ("+", (0.72, 0.8))
    field = of.system.field(mode)
    jacobian = ca.jacobian(field, of.system.extended_states)
    for _ in range(20):
        x = x - np.linalg.solve(of.evaluate(jacobian, x), of.evaluate(field, x).ravel())
    eigenvalues = np.linalg.eigvals(of.evaluate(jacobian, x))
    assert np.iscomplexobj(eigenvalues) == (mode == "-")
    return x[1]


def harvest_double_zero(of):
    """Largest alpha for which x1' = 0 has a solution on the surface: alpha as a function of x1."""

    def level(x):
        return brentq(lambda a: of.sliding([x, a], alpha=a)[0], 0.1, 3.0, xtol=1e-15)

    return level(brentq(lambda x: richardson(lambda s: level(x + s), 1e-2), 0.2, 0.5, xtol=1e-12))


def welander_boundary(of):
    field, zero = of.system.field("-" if of.quantity.endswith("0") else "+"), np.zeros(2)
    jacobian = of.evaluate(ca.jacobian(field, of.system.extended_states), zero)
    x = np.linalg.solve(jacobian, -of.evaluate(field, zero).ravel())
    return x[1] - of.parameters["a"] * x[0]


def welander_rest(of):
    run = of.run(100.0)
    assert run.segments[-1].mode == "s"
    return run.x[-1, 0]


def jump(of, name, component):
    start = dict(zip(of.system.state_names, of.problem.start, strict=True))
    base = {**of.parameters, **start}[name]
    return richardson(lambda s: of.problem.run({name: base + s}, tol=TOL).x[-1, component], 2e-2)


def two_fold_number(of):
    """From the linear sliding flow, scaled by z2 + z3, at two points."""
    points = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    matrix = np.array([of.sliding(z)[1:] * (z[1] + z[2]) for z in points]).T
    trace, determinant = np.trace(matrix), np.linalg.det(matrix)
    values = {"trace": trace, "determinant": determinant}
    return values.get(of.quantity, trace**2 - 4 * determinant)


def circle(of):
    start = np.array(of.problem.start)
    return brentq(lambda t: (of.run()(t) - start)[0], of.known - 0.5, of.known + 0.5, xtol=1e-14)


def shaken_slip(of):
    angle = 2.0 * of.problem.t_end
    return np.linalg.norm(of.end[2:] - [math.cos(angle), math.sin(angle)])


def soft_touch(of):
    event = ns.continue_orbit(of.orbit, "F", bounds=(0.25, 0.42)).events[0]
    assert event.kind == "grazing of a soft switch"
    return event.parameter


def chua_values(of):
    values = of.equilibrium([1.4, 0, -1.4], mode="++").eigenvalues
    real, pair = values[values.imag == 0][0], values[values.imag > 0][0]
    return [real.real, pair.real, pair.imag]


def mckean_corner(of):
    start = of.equilibrium([0.25, 0.5], mode="+-").point
    events = of.branch(start, "I", (0.2, 0.6), mode="+-")
    (event,) = [e for e in events if e.kind == "boundary equilibrium"]
    assert event.far_side.verdict.startswith("persistence")
    return event.parameter


def spikes_together(of):
    spikes = [of.times(f"spike {i}")[1:] for i in (1, 2, 3)]
    np.testing.assert_allclose(spikes[1:], [spikes[0]] * 2, rtol=1e-13)
    return spikes[0]


def speed_ratio(of):
    speeds = [abs(e.x[1]) for e in of.events("h0") if e.x[1]]
    return speeds[1] / speeds[0]


def drill_hopf(of):
    given = {**of.parameters, "W": 5.0}
    events = of.branch([1 + 2 / 6, 5.0], "W", (2.0, 6.0), parameters=given)
    (event,) = [e for e in events if e.kind == "Hopf"]
    return event.parameter


def stommel(of, kind):
    start = of.equilibrium([2.1, 1.6], side="+").point
    return next(e.parameter for e in of.branch(start, "e", (0.5, 1.5)) if e.kind == kind)


def relay_slide(of):
    assert of.run().itinerary == "s"
    return of.end[0]


def relay_node(of):
    x = brentq(lambda x: of.sliding([x, -x])[0], -1.0, 1.5, xtol=1e-15)
    return x, -x


def entered(of):
    """When x = 1 is passed to the right."""
    return np.diff([e.t for e in of.run(20.0).events if e.x[0] == 1.0 and e.x[1] > 0.0])[0]


def moves(run):
    return run.status is not ns.Status.INCONSISTENT


def sticks(run):
    return run.itinerary == "s"


# every value: of a run, of its events, of a periodic orbit ------------------------------------------

PERIOD, MULTIPLIER = lambda of: of.orbit.period, lambda of: of.multiplier
MULTIPLIERS, PAIR = lambda of: of.orbit.multipliers.real, lambda of: of.pair
END, ENTRY, REST = (
    lambda of: of.end,
    lambda of: of.times("entry")[0],
    lambda of: of.times("rest")[0],
)
SLIP, EXITS = lambda of: of.length("-"), lambda of: np.diff(of.times("exit"))[-1]
CYCLE = {"period": PERIOD, "multiplier": MULTIPLIER}
PARADOX = lambda of: switch(of, lambda mu: {"mu": mu}, 1e-6, 1.0, 2.0, moves, 1e-11)

CHECKS = {
    "abs_brake": {
        "braking time": lambda of: of.times("stop")[0],
        "mean of the relay": lambda of: 1 - 2 * ns.alpha(of.system, of.problem.start),
    },
    "ambiguous_exit": {
        "exit time, bilinear": bilinear_exit,
        "exit times allowed": exits_allowed,
    },
    "backlash": {"period": entered, "amplitude": lambda of: of.run()(2.0 + np.pi / 2)[0]},
    "belt_oscillator": {"multipliers": MULTIPLIERS},
    "bilinear_oscillator": {
        "period": lambda of: np.diff(of.times("h0")[::2])[0],
        "amplitude to the right": lambda of: of.run()(np.pi / 2 + np.pi / 4)[0],
    },
    "block_on_belt": {
        "carried away (x1, x2, t)": lambda of: (*of.events("entry")[0].x[:2], ENTRY(of)),
        "halfway (x1, x2)": lambda of: of.run()(2.0)[:2],
        "end (x1, x2)": lambda of: of.end[:2],
    },
    "block_on_disc": {
        "sticks (t)": ENTRY,
        "end (x1, x2)": lambda of: of.end[:2],
        "friction on the disc": lambda of: switch(
            of, lambda r: {"x1": r, "v1": 0.0, "v2": r}, 1e-3, 0.3, 0.7, sticks
        ),
    },
    "block_on_incline": {"rest (t)": ENTRY, "rest (x1, x2)": lambda of: of.end[:2]},
    "boost_converter": {
        "end": END,
        "voltage": lambda of: next(leg.start[1] for leg in of.orbit.legs if leg.start[2] == 0.0),
        "conduction": lambda of: next(leg.duration for leg in of.orbit.legs if leg.mode == "+o"),
        "multiplier": MULTIPLIER,
    },
    "bouncing_ball": {"first impact": lambda of: of.run().events[0].t, "Zeno time": limit},
    "buck_converter": {
        "multiplier (re, im)": PAIR,
        "multiplier at the period doubling": MULTIPLIER,
    },
    "chua_circuit": {
        "outer equilibrium": lambda of: of.equilibrium([1.4, 0, -1.4], mode="++").point,
        "eigenvalues there": chua_values,
        "unstable eigenvalue at 0": lambda of: max(
            of.equilibrium([0.1, 0, 0], mode="+-").eigenvalues.real
        ),
    },
    "cue_ball": {
        "rolls (t)": ENTRY,
        "rolls (x1, x2)": lambda of: of.events("entry")[0].x[:2],
        "rolls (v1, v2)": lambda of: of.end[2:4],
    },
    "diode_bridge": {
        "first change": lambda of: of.times("crossing")[0],
        "interval": lambda of: np.diff(of.times("crossing")).mean(),
        "end": END,
    },
    "drill_string": {
        "critical speed": drill_hopf,
        "break-away": lambda of: (
            of.events("exit")[0].x[0] + of.parameters["c"] * of.parameters["W"]
        ),
    },
    "dry_friction": {
        **{
            f"turn {k + 1} (y1, t)": lambda of, k=k: (
                of.events("crossing")[k].x[0],
                of.times("crossing")[k],
            )
            for k in range(3)
        },
        "rest (y1, t)": lambda of: (of.events("entry")[0].x[0], ENTRY(of)),
        "end y1": lambda of: of.end[0],
    },
    "forced_dry_friction": {
        "turning point": lambda of: max(leg.start[0] for leg in of.orbit.legs),
        "multiplier (re, im)": PAIR,
        "stick time": lambda of: next(leg.duration for leg in of.orbit.legs if leg.mode == "s"),
        "multiplier": lambda of: of.orbit.multipliers[0].real,
    },
    "gearbox": {
        "shifts": lambda of: of.times("up"),
        "slowest eigenvalue": lambda of: of.equilibrium([3.0, 3]).eigenvalues[0],
    },
    "glacial_cycles": {"period": lambda of: np.diff(of.times("glaciation")).mean()},
    "glass_loop": {
        "crossing times 1 to 4": gene_switches,
        "distance at crossing 4": lambda of: np.abs(of.run().events[3].x - 0.5).sum(),
    },
    "harvested_prey_predator": {
        **dict.fromkeys(("fold of F2", "fold of F1"), harvest_fold),
        **dict.fromkeys(("boundary focus", "boundary node"), harvest_boundary),
        "pseudo-saddle-node": harvest_double_zero,
    },
    "hidden_dynamics": {
        "x2' off the surface": off_surface,
        **dict.fromkeys(("x2' sliding, nonlinear", "x2' sliding, linear"), hidden),
    },
    "impact_oscillator": {"grazing amplitude": grazing},
    "integrate_and_fire": {
        "period": lambda of: np.diff(of.times("spike")).mean(),
        "slope of the period": lambda of: of.orbit.derivative("I").period,
    },
    "integrate_and_fire_network": {
        "spikes of the first neuron": lambda of: of.times("spike 0"),
        "spikes of the others together": spikes_together,
    },
    "integrate_and_fire_pair": CYCLE,
    "kelvin_voigt_bounce": {
        "separation time": lambda of: bounce(of).t[-1],
        "Y' at separation": lambda of: of.end[3],
        "sticking time": ENTRY,
        "slip restarts": slipping,
        **dict.fromkeys(("slip at separation", "slip at separation, fast spin"), last_slip),
        "critical spin": critical_spin,
    },
    "leine_stick_slip": {
        "slip time": SLIP,
        "stick time": lambda of: of.length("s"),
        "x at re-stick": lambda of: of.events("entry")[-1].x[0],
        "period": EXITS,
        "multipliers": MULTIPLIERS,
    },
    "mckean_neuron": {
        "corner": mckean_corner,
        "equilibrium": lambda of: of.equilibrium([0.3, 0.5], mode="+-").point,
        "trace there": lambda of: sum(of.equilibrium([0.3, 0.5], mode="+-").eigenvalues.real),
    },
    "multi_sliding_relay": CYCLE,
    "painleve_rod": {
        "paradox": PARADOX,
        "least friction": PARADOX,
        "sticks (t, a)": lambda of: (ENTRY(of), of.events("entry")[0].x[2]),
    },
    "piecewise_cycle": {"radius": lambda of: np.linalg.norm(of.orbit.start), **CYCLE},
    "pivoting_disc": {"rest (t)": ENTRY, "rest (x1, x2, phi)": lambda of: of.end[:3]},
    "planar_relay": {
        **{
            f"fold of F{k}": lambda of, side=side: brentq(
                lambda x: of.rate(side, [x, -x]), -9.0, 9.0, xtol=1e-15
            )
            for k, side in ((1, "+"), (2, "-"))
        },
        "x(2)": relay_slide,
        "pseudo-node": relay_node,
        "slope of the sliding field": lambda of: richardson(lambda x: of.sliding([x, -x])[0], 0.1),
    },
    "pseudo_hopf": {
        "x0": lambda of: max(-leg.start[0] for leg in of.orbit.legs),
        **CYCLE,
        "pseudo-node": lambda of: brentq(
            lambda x: of.sliding([x, 0.0])[0], -0.025, -0.005, xtol=1e-16
        ),
    },
    "resonant_converter": {
        **CYCLE,
        "amplitude": lambda of: max(abs(leg.start[1]) for leg in of.orbit.legs),
    },
    "rocking_block": {
        "upright": lambda of: of.times("other corner")[:2],
        "standing time": REST,
    },
    "scalar_repelling": {
        "time of the status": repelled,
        **{
            f"x(1) leaving {way}": lambda of, mode=mode: of.problem.run(start_mode=mode).x[-1, 0]
            for way, mode in (("up", "+"), ("down", "-"))
        },
    },
    "scalar_sliding": {
        "switch time": ENTRY,
        "end": lambda of: of.end[0],
        "alpha": lambda of: of.rate("+", [0.0]) / (of.rate("+", [0.0]) - of.rate("-", [0.0])),
    },
    "shaken_block": {
        "speed in the end": lambda of: np.linalg.norm(of.end[2:]),
        "slip in the end": shaken_slip,
        "least friction that holds": lambda of: switch(
            of, lambda mu_g: {"v1": 1.0, "mu_g": mu_g}, 1e-3, 1.5, 2.5, sticks
        ),
    },
    "simplest_walker": {
        "long step": PERIOD,
        "multiplier (re, im)": PAIR,
        "short step": PERIOD,
        "multiplier of short steps": MULTIPLIER,
    },
    "sir_threshold": {
        "susceptibles at the entry": lambda of: of.events("entry")[0].x[0],
        "duration of the policy": lambda of: of.times("exit")[0] - ENTRY(of),
        "final size": lambda of: of.end[0],
    },
    "slider_crank": {"end": END},
    "soft_stop": {"touch": soft_touch, "modulus": lambda of: abs(of.orbit.multipliers[0])},
    "spiral_oscillator": {
        "crossing time": lambda of: of.run().events[0].t,
        "crossing state": lambda of: of.run().events[0].x,
        "state at pi/2": END,
    },
    "state_dependent_jump": {
        "switch times": lambda of: of.times("crossing"),
        "x(20)": END,
        "dx1(20)/dx0": lambda of: [jump(of, name, 0) for name in ("x1", "x2")],
        "dx2(20)/dx0": lambda of: [jump(of, name, 1) for name in ("x1", "x2")],
        "dx(20)/dp": lambda of: [jump(of, "p", component) for component in (0, 1)],
    },
    "stick_slip_exponential": {
        "exit (x1, x2)": lambda of: of.events("exit")[-1].x,
        "slip time": SLIP,
        "landing x1": lambda of: of.events("entry")[-1].x[0],
        "period": EXITS,
        "multipliers": MULTIPLIERS,
    },
    "stommel_box": {
        "nonsmooth fold": lambda of: stommel(of, "boundary equilibrium"),
        "smooth fold": lambda of: stommel(of, "fold"),
    },
    "super_twisting": {"limit": REST},
    "tank_cascade": {"empty": lambda of: of.times("entry", "rest")},
    "thermostat": {
        "period": lambda of: np.diff(of.times("on")).mean(),
        "slope of the period": lambda of: of.orbit.derivative("a").period,
    },
    "threshold_harvesting": {
        "threshold time": ENTRY,
        "effort": lambda of: 1 - ns.alpha(of.system, [of.parameters["T"]]),
        "least h": lambda of: (
            ns.find_boundary_equilibrium(of.system, [0.6], vary="h", side="+").value
        ),
    },
    "turntable": {
        "period": circle,
        "opposite point (x1, x2)": lambda of: of.run()(of.problem["period"].value / 2)[:2],
    },
    "twisting": {
        "first switch": lambda of: of.run().events[0].t,
        "speed ratio": speed_ratio,
        "limit": REST,
    },
    "two_fold": dict.fromkeys(("trace", "determinant", "discriminant"), two_fold_number),
    "two_relay_spiral": {
        "switch times 1 to 4": lambda of: [e.t for e in of.run().events[:4]],
        "time of rest": REST,
    },
    "welander_box": {
        **dict.fromkeys((f"boundary equilibrium, k = {k}" for k in (0, 5)), welander_boundary),
        **CYCLE,
        "pseudo-equilibrium T": welander_rest,
    },
    "woodpecker": {"end": END},
}

ALL = [(name, r) for name, make in textbook.PROBLEMS.items() for r in make().references]


@pytest.mark.parametrize(("name", "reference"), ALL, ids=lambda v: getattr(v, "quantity", v))
def test_reference(name, reference):
    computed = CHECKS[name][reference.quantity](Of(name, reference))
    assert reference.agrees(computed), (
        f"{reference}: computed {computed}, {reference.error(computed):.2e}"
    )


def test_every_check_belongs_to_a_reference():
    found = {(name, quantity) for name, checks in CHECKS.items() for quantity in checks}
    assert found == {(name, r.quantity) for name, r in ALL}


def test_hidden_dynamics_are_refused_unless_meant():
    x, lam = ca.SX.sym("x"), ca.SX.sym("lam")
    with pytest.raises(ns.DefinitionError, match=r"multiplier lam.*linear"):
        ns.FilippovSystem([x], surface=x, multipliers=lam, field=[0.2 - lam**3])
