"""How the values of hybrid automata, springs, controllers and thresholds are computed."""

import functools

import numpy as np
from scipy.optimize import brentq

import nonsmooth as ns

CHECKS = {}


def check(name, *quantities):
    """Register a function of a problem for quantities of it."""

    def register(function):
        for quantity in quantities:
            CHECKS[name, quantity] = lambda problem, _, function=function: function(problem)
        return function

    return register


def run_of(problem, t_end=None):
    return problem.run(t_end=t_end, tol=1e-13)


def times(problem, name, t_end=None):
    return [event.t for event in run_of(problem, t_end).events if event.name == name]


def orbit_of(problem, **options):
    return ns.periodic_orbit(problem.system, run_of(problem), **options)


def first(problem, kind):
    return next(event for event in run_of(problem).events if event.kind == kind)


# springs -----------------------------------------------------------------------------------------


def strobed(problem):
    return ns.periodic_orbit(problem.system, list(problem.start), period=2 * np.pi / 0.8)


@check("soft_stop", "touch")
def _(problem):
    branch = ns.continue_orbit(strobed(problem), "F", bounds=(0.25, 0.42))
    assert branch.events[0].kind == "grazing of a soft switch"
    return branch.events[0].parameter


check("soft_stop", "modulus")(lambda problem: abs(strobed(problem).multipliers[0]))
check("bilinear_oscillator", "period")(lambda problem: np.diff(times(problem, "h0")[::2])[0])
check("bilinear_oscillator", "amplitude to the right")(
    lambda problem: run_of(problem)(np.pi / 2 + np.pi / 4)[0]
)


@check("backlash", "period")
def _(problem):
    run = run_of(problem, 20.0)
    entered = [e.t for e in run.events if e.x[0] == 1.0 and e.x[1] > 0.0]
    return np.diff(entered)[0]


check("backlash", "amplitude")(lambda problem: run_of(problem)(2.0 + np.pi / 2)[0])


def of_chua(problem, at):
    return ns.find_equilibrium(problem.system, at, mode="++" if at[0] > 1 else "+-")


check("chua_circuit", "outer equilibrium")(lambda problem: of_chua(problem, [1.4, 0, -1.4]).point)


@check("chua_circuit", "eigenvalues there")
def _(problem):
    values = of_chua(problem, [1.4, 0, -1.4]).eigenvalues
    real, pair = values[values.imag == 0][0], values[values.imag > 0][0]
    return [real.real, pair.real, pair.imag]


check("chua_circuit", "unstable eigenvalue at 0")(
    lambda problem: ns.find_equilibrium(
        problem.system, [0.1, 0, 0], mode="+-"
    ).eigenvalues.real.max()
)


@check("mckean_neuron", "corner")
def _(problem):
    start = ns.find_equilibrium(problem.system, [0.25, 0.5], mode="+-").point
    branch = ns.continue_equilibrium(
        problem.system, start, "I", bounds=(0.2, 0.6), side="+", mode="+-"
    )
    (event,) = [e for e in branch.events if e.kind == "boundary equilibrium"]
    assert event.far_side.verdict.startswith("persistence")
    return event.parameter


def of_mckean(problem):
    return ns.find_equilibrium(problem.system, [0.3, 0.5], mode="+-")


check("mckean_neuron", "equilibrium")(lambda problem: of_mckean(problem).point)
check("mckean_neuron", "trace there")(lambda problem: of_mckean(problem).eigenvalues.sum().real)

# hybrid automata ---------------------------------------------------------------------------------

for _name, _event, _parameter in (
    ("thermostat", "on", "a"),
    ("glacial_cycles", "glaciation", None),
    ("integrate_and_fire", "spike", "I"),
):
    check(_name, "period")(lambda problem, event=_event: np.diff(times(problem, event)).mean())
    if _parameter:
        check(_name, "slope of the period")(
            lambda problem, by=_parameter: orbit_of(problem).derivative(by).period
        )
check("gearbox", "shifts")(lambda problem: times(problem, "up"))
check("gearbox", "slowest eigenvalue")(
    lambda problem: ns.find_equilibrium(problem.system, [3.0, 3]).eigenvalues[0]
)
check("integrate_and_fire_pair", "period")(lambda problem: orbit_of(problem).period)
check("integrate_and_fire_pair", "multiplier")(
    lambda problem: orbit_of(problem).multipliers[1].real
)
check("integrate_and_fire_network", "spikes of the first neuron")(
    lambda problem: times(problem, "spike 0")
)


@check("integrate_and_fire_network", "spikes of the others together")
def _(problem):
    spikes = [times(problem, f"spike {i}") for i in (1, 2, 3)]
    np.testing.assert_allclose(spikes[0][1:], spikes[1][1:], rtol=1e-13)
    np.testing.assert_allclose(spikes[0][1:], spikes[2][1:], rtol=1e-13)
    return spikes[0][1:]


check("rocking_block", "upright")(lambda problem: times(problem, "other corner")[:2])
check("rocking_block", "standing time")(lambda problem: first(problem, "rest").t)

# control -----------------------------------------------------------------------------------------

check("twisting", "first switch")(lambda problem: run_of(problem).events[0].t)
check("twisting", "limit")(lambda problem: first(problem, "rest").t)
check("super_twisting", "limit")(lambda problem: first(problem, "rest").t)


@check("twisting", "speed ratio")
def _(problem):
    speeds = [abs(e.x[1]) for e in run_of(problem).events if e.name == "h0" and e.x[1]]
    return speeds[1] / speeds[0]


check("abs_brake", "braking time")(lambda problem: first(problem, "stop").t)
check("abs_brake", "mean of the relay")(
    lambda problem: 1 - 2 * ns.alpha(problem.system, problem.start)
)


@check("drill_string", "critical speed")
def _(problem):
    given = {**problem.parameters, "W": 5.0}
    start = [1 + 2 / 6, 5.0]
    branch = ns.continue_equilibrium(
        problem.system, start, "W", bounds=(2.0, 6.0), side="+", parameters=given
    )
    (event,) = [e for e in branch.events if e.kind == "Hopf"]
    return event.parameter


@check("drill_string", "break-away")
def _(problem):
    event = first(problem, "exit")
    return event.x[0] + problem.parameters["c"] * problem.parameters["W"]


check("resonant_converter", "period")(lambda problem: orbit_of(problem).period)
check("resonant_converter", "amplitude")(
    lambda problem: max(abs(leg.start[1]) for leg in orbit_of(problem).legs)
)
check("resonant_converter", "multiplier")(lambda problem: orbit_of(problem).multipliers[1].real)
check("diode_bridge", "first change")(lambda problem: first(problem, "crossing").t)
check("diode_bridge", "interval")(
    lambda problem: (
        np.diff([e.t for e in run_of(problem).events if e.kind == "crossing"]) @ np.full(15, 1 / 15)
    )
)
for _name in ("diode_bridge", "boost_converter", "woodpecker", "slider_crank"):
    check(_name, "end")(lambda problem: run_of(problem).x[-1])


@functools.cache
def discontinuous(problem):
    return ns.periodic_orbit(problem.system, run_of(problem, 400.0))


@check("boost_converter", "voltage")
def _(problem):
    return next(leg.start[1] for leg in discontinuous(problem).legs if leg.start[2] == 0.0)


@check("boost_converter", "conduction")
def _(problem):
    return next(leg.duration for leg in discontinuous(problem).legs if leg.mode == "+o")


check("boost_converter", "multiplier")(lambda problem: discontinuous(problem).multipliers[1].real)
check("tank_cascade", "empty")(
    lambda problem: [e.t for e in run_of(problem).events if e.kind in ("entry", "rest")]
)

# mechanisms --------------------------------------------------------------------------------------


def paradox(at):
    """The friction from which the rod that slides at an angle has no motion."""

    def moves(problem):
        def status(mu):
            run = problem.run({**at, "mu": mu}, t_end=1e-6)
            return -1.0 if run.status is ns.Status.INCONSISTENT else 1.0

        return brentq(status, 1.0, 2.0, xtol=1e-11)

    return moves


check("painleve_rod", "paradox")(paradox({}))
check("painleve_rod", "least friction")(
    paradox({"a": float(np.arctan(2)), "y": float(np.sin(np.arctan(2))) / 2})
)


@check("painleve_rod", "sticks (t, a)")
def _(problem):
    event = first(problem, "entry")
    return event.t, event.x[2]


# thresholds --------------------------------------------------------------------------------------

check("threshold_harvesting", "threshold time")(lambda problem: first(problem, "entry").t)
check("threshold_harvesting", "effort")(
    lambda problem: 1 - ns.alpha(problem.system, [problem.parameters["T"]])
)


@check("threshold_harvesting", "least h")
def _(problem):
    found = ns.find_boundary_equilibrium(problem.system, [0.6], vary="h", side="+")
    return found.value


check("sir_threshold", "susceptibles at the entry")(lambda problem: first(problem, "entry").x[0])
check("sir_threshold", "duration of the policy")(
    lambda problem: first(problem, "exit").t - first(problem, "entry").t
)
check("sir_threshold", "final size")(lambda problem: run_of(problem).x[-1, 0])


def stommel_branch(problem):
    start = ns.find_equilibrium(problem.system, [2.1, 1.6], side="+").point
    return ns.continue_equilibrium(problem.system, start, "e", bounds=(0.5, 1.5), side="+")


def stommel_event(kind):
    def value(problem):
        return next(e.parameter for e in stommel_branch(problem).events if e.kind == kind)

    return value


check("stommel_box", "nonsmooth fold")(stommel_event("boundary equilibrium"))
check("stommel_box", "smooth fold")(stommel_event("fold"))
