"""Time and error of periodic orbits, branches, gradients and arcs beside scipy and heyoka.

scipy has finite differences for derivatives; heyoka is compared on one arc with its derivatives.
Orbits start from two digits of a state, those of the relay from a run; all are solved with the itinerary
given, and with their multipliers. Values are compared with closed forms or 20 digits of mpmath
(``tests/data/orbits.json``).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

import nonsmooth as ns
from nonsmooth.orbit.runs.leg_integration import LegIntegrator

from ..peers import scipy_shooting
from ..timing import Timing, alternate

TOLERANCES = (1e-9, 1e-11, 1e-13)


@dataclass(frozen=True)
class Case:
    """A periodic orbit with its reference solution."""

    solve: Callable[[], ns.orbit.PeriodicOrbit]
    state: dict[int, float]
    time: float
    multipliers: tuple[complex, ...]


def walker() -> Case:
    """W1: the long gait of the simplest walker (Garcia et al. 1998)."""
    system = ns.textbook.simplest_walker().system
    start = [0.20, -0.20, 0.40, (1 - math.cos(0.40)) * -0.20]
    pair = complex(-0.1900998410658881, 0.5575987766820683)
    return Case(
        lambda: ns.periodic_orbit(system, start, itinerary=[("", "heelstrike")]),
        {0: 0.2003109005442470893602, 1: -0.1998324730049523545376},
        3.88246375285137413757,
        (pair, pair.conjugate()),
    )


def dry_friction() -> Case:
    """D5: forced dry friction with a stick in each half period (Shaw 1986)."""
    system = ns.textbook.forced_dry_friction().system
    return Case(
        lambda: ns.periodic_orbit(
            system,
            [1.44, 0.0],
            itinerary="s -",
            symmetry="odd",
            parameters={"f": 0.6},
            t_start=0.64,
        ),
        {0: 1.443224131707788047057},
        math.pi / 0.6,
        (-0.2186500320099493839797,),
    )


def relay() -> Case:
    """R1: a relay that slides seven times in half a period (di Bernardo, Johansson & Vasca 2001)."""
    system = ns.textbook.multi_sliding_relay().system
    modes = ["+", "s"] * 7
    return Case(
        lambda: ns.periodic_orbit(system, [0.0, 1.0, 2.57], itinerary=modes, symmetry="odd"),
        {2: 2.572662315355571459927},
        5.961836942613702773842 / 2,
        (-0.0424866124866563824773,),
    )


CASES: dict[str, Callable[[], Case]] = {"W1": walker, "D5": dry_friction, "R1": relay}


def errors(case: Case, state: Any, duration: float, multipliers: Any) -> dict[str, float]:
    """Relative errors of state and time, and the absolute one of the multipliers."""
    found = np.asarray(multipliers, complex)
    miss = [abs(abs(state[k]) - abs(v)) / abs(v) for k, v in case.state.items()]
    return {
        "orbit": float(max(*miss, abs(duration - case.time) / case.time)),
        "multipliers": float(max(np.abs(found - m).min() for m in case.multipliers)),
    }


def _ours(case: Case, orbit: ns.orbit.PeriodicOrbit) -> dict[str, float]:
    n = 1 if orbit.symmetric else 0
    return errors(case, orbit.start, orbit.period / (1 + n), orbit.half_multipliers)


def orbits(quick: bool) -> dict[str, Any]:
    """Time and error of converged orbits with multipliers."""
    result: dict[str, Any] = {}
    for name, make in CASES.items():
        case = make()
        work: dict[str, Callable[[], Any]] = {"nonsmooth": case.solve}
        found = {"nonsmooth": _ours(case, case.solve())}
        for tol in TOLERANCES[-1:] if quick else TOLERANCES:
            for whole in (False, True):
                label = f"scipy DOP853, {'every state' if whole else 'section'}, {tol:g}"
                work[label] = _peer(name, tol, whole)
                found[label] = errors(case, *work[label]())
        if name == "R1":
            label = f"scipy DOP853, section, {TOLERANCES[1]:g}, no limit of steps"
            work[label] = _peer("R1 unlimited", TOLERANCES[1], False)
            found[label] = errors(case, *work[label]())
        # a turn of the library is about as long as one of the peer
        many = 3 if quick else 40
        again = partial(_repeated, case.solve, many)
        timings = alternate({**work, "nonsmooth": again}, 2 if quick else 7)
        result[name] = {
            label: {
                "seconds": _each(timings[label], many if label == "nonsmooth" else 1),
                **found[label],
            }
            for label in work
        }
    return result


def _repeated(solve: Callable[[], Any], count: int) -> None:
    for _ in range(count):
        solve()


def _each(timing: Timing, count: int) -> dict[str, Any]:
    return Timing(
        timing.median / count, timing.low / count, timing.high / count, timing.turns
    ).as_dict()


def _peer(name: str, tol: float, whole: bool) -> Callable[[], Any]:
    return lambda: scipy_shooting.solve(name, tol, whole)


def iterations(quick: bool) -> dict[str, Any]:
    """A step of Newton's method over a simulated period, in turns."""
    result: dict[str, Any] = {}
    for name, make in CASES.items():
        orbit = make().solve()
        problem, p, u = orbit.problem, orbit.parameter_vector, orbit.unknowns
        n, system = orbit.system.dimension, orbit.system
        x = orbit.evaluation.starts[0]
        t = float(x[n]) if system.time_dependent else 0.0
        # a little later: at the start itself a reset, or an entry, is due
        delay = 1e-3 * float(orbit.evaluation.durations[0])
        later = ns.flow.follow(
            system,
            x[:n],
            t + delay,
            mode=problem.legs[0].mode,
            t_start=t,
            parameters=orbit.parameters,
        ).x[-1]
        span = float(orbit.evaluation.durations.sum()) - 2 * delay

        def step(problem: Any = problem, u: Any = u, p: Any = p) -> Any:
            at = problem.evaluate(u, p)
            return problem.solve(at.jacobian, at.residual)

        def period(
            system: Any = system,
            later: Any = later,
            t: float = t + delay,
            span: float = span,
            given: Any = orbit.parameters,
        ) -> Any:
            return ns.simulate(system, later, t + span, t_start=t, parameters=given, tol=1e-13)

        timings = alternate({"step": step, "period": period}, 3 if quick else 25)
        result[name] = {k: v.as_dict() for k, v in timings.items()}
    return result


def two_blocks() -> tuple[ns.orbit.PeriodicOrbit, str, tuple[float, float]]:
    """Two coupled oscillators, one on a belt: R^4."""
    x, v, u, w, f, c = (ca.SX.sym(s) for s in ("x", "v", "u", "w", "f", "c"))
    slip = v - 0.5
    system = ns.FilippovSystem(
        [x, v, u, w],
        surface=slip,
        above=[v, -x - c * (x - u) - f + 0.2 * slip, w, -2 * u - c * (u - x) - 0.3 * w],
        below=[v, -x - c * (x - u) + f + 0.2 * slip, w, -2 * u - c * (u - x) - 0.3 * w],
        parameters={f: 1.0, c: 0.3},
    )
    run = ns.simulate(system, [0.3, 0.4, 0.0, 0.0], 60.0)
    return ns.periodic_orbit(system, run), "f", (0.8, 1.3)


def bounces() -> tuple[ns.orbit.PeriodicOrbit, str, tuple[float, float]]:
    """A ball on a table that vibrates, with the restitution as a parameter."""
    y, v, t, r = (ca.SX.sym(s) for s in ("y", "v", "t", "r"))
    speed = 0.5 * ca.cos(2 * t)
    hit = ns.Reset(y - 0.25 * ca.sin(2 * t), [y, speed - r * (v - speed)], -1, "hit")
    system = ns.FilippovSystem([y, v], field=[v, -1.0], time=t, resets=hit, parameters={r: 0.6})
    phase = math.acos(math.pi / 4)
    start = [0.25 * math.sin(phase), 0.5 * math.pi]
    orbit = ns.periodic_orbit(system, start, itinerary=[("", "hit")], t_start=0.5 * phase)
    return orbit, "r", (0.53, 0.7)


def branches(quick: bool) -> dict[str, Any]:
    """Points of a branch in a second, all tests on."""
    system = ns.textbook.forced_dry_friction().system
    run = ns.simulate(system, [1.5, 0.0], 100.0, parameters={"f": 0.6})
    gait = walker().solve()
    cases = {
        "R^4, sticking once": two_blocks(),
        "forced friction, four legs": (ns.periodic_orbit(system, run), "f", (0.55, 0.65)),
        "forced friction, half the orbit": (dry_friction().solve(), "f", (0.55, 0.65)),
        "walker, one leg in R^4": (gait, gait.system.parameter_names[0], (0.005, 0.018)),
        "bounces, a parameter of a reset": bounces(),
    }
    result: dict[str, Any] = {}
    for name, (orbit, parameter, bounds) in cases.items():

        def follow(orbit: Any = orbit, parameter: Any = parameter, bounds: Any = bounds) -> Any:
            return ns.continue_orbit(orbit, parameter, bounds=bounds, step=0.02)

        points = len(follow().orbits)
        timing = alternate({name: follow}, 3 if quick else 15)[name]
        result[name] = {"legs": len(orbit.legs), "points": points, **timing.as_dict()}
    return result


def _network(count: int) -> tuple[ns.FilippovSystem, Any]:
    """Neurons x' = -x + W relu(x), each entry of W a parameter, and a start."""
    rng = np.random.default_rng(1)
    x, w = ca.SX.sym("x", count), ca.SX.sym("w", count * count)
    rate = -x + ca.reshape(w, count, count) @ ca.fmax(x, 0)
    values = rng.normal(size=count * count) * 1.5 / np.sqrt(count)
    given = dict(zip(ca.vertsplit(w), values, strict=True))
    rates = ca.vertsplit(rate)
    system = ns.FilippovSystem.from_expression(ca.vertsplit(x), rates, parameters=given)
    return system, rng.normal(size=count)


def gradients(quick: bool) -> dict[str, Any]:
    """Time of a gradient over that of the run, in turns."""
    relay = ns.textbook.multi_sliding_relay().system
    friction = ns.textbook.forced_dry_friction().system
    runs = {
        "relay, 15 events": (relay, [0.0, -0.001, -0.02], 6.0),
        "forced friction, 7 events": (friction, [1.5, 0.0], 40.0),
        "20 neurons with 400 weights": (*_network(20), 10.0),
    }
    result: dict[str, Any] = {}
    for name, (system, start, end) in runs.items():
        few = system.dimension < 6
        names = system.parameter_names[: 6 - system.dimension if few else None]
        run, row = ns.simulate(system, start, end), np.ones(system.dimension)

        def simulated(system: Any = system, start: Any = start, end: float = end) -> Any:
            return ns.simulate(system, start, end)

        def pulled(run: Any = run, row: Any = row, names: Any = names) -> Any:
            return ns.vjp(run, row, wrt=names)

        timings = alternate({"run": simulated, "gradient": pulled}, 3 if quick else 25)
        result[name] = {k: v.as_dict() for k, v in timings.items()}
    return result


def leg(quick: bool) -> dict[str, Any]:
    """The walker's step with all derivatives by its start, beside heyoka's variational equations."""
    orbit = walker().solve()
    integrator = LegIntegrator(orbit.system, orbit.problem.legs)
    starts, durations = orbit.evaluation.starts, orbit.evaluation.durations
    p = orbit.parameter_vector
    work: dict[str, Callable[[], Any]] = {"nonsmooth": lambda: integrator(starts, durations, p)}
    found = {"nonsmooth": integrator(starts, durations, p).by_start[0]}
    compiled = {"nonsmooth": 0.0}
    try:
        begin = time.process_time()
        work["heyoka"] = _variational(starts[0], float(durations[0]))
        compiled["heyoka"] = time.process_time() - begin
        found["heyoka"] = work["heyoka"]()
    except ImportError:
        pass
    timings = alternate(work, 5 if quick else 51)
    apart = float(max(np.abs(x - found["nonsmooth"]).max() for x in found.values()))
    return {
        "apart": apart,
        "solvers": {k: {**t.as_dict(), "to compile": compiled[k]} for k, t in timings.items()},
    }


def _variational(start: Any, duration: float) -> Callable[[], Any]:
    import heyoka as hy

    angle, rate, swing, speed = hy.make_vars("angle", "rate", "swing", "speed")
    slope = 0.009
    a = hy.sin(angle - slope)
    b = a + (rate**2 - hy.cos(angle - slope)) * hy.sin(swing)
    field = [(angle, rate), (rate, a), (swing, speed), (speed, b)]
    whole = hy.var_ode_sys(field, args=hy.var_args.vars, order=1)
    solver = hy.taylor_adaptive(whole, state=list(start), compact_mode=False)
    begin = np.array(solver.state)

    def run() -> Any:
        solver.time = 0.0
        solver.state[:] = begin
        solver.propagate_until(duration)
        return np.array(solver.state[4:]).reshape(4, 4)

    return run


#: Name, limit, and whether more is better.
TARGETS = {
    **{
        f"orbit {name}: times scipy, every state{turns}": (100.0, "at least")
        for name in CASES
        for turns in ("", ", fastest turns")
    },
    **{f"orbit {name}: step of Newton's method, in periods": (4.0, "at most") for name in CASES},
    "branch of four legs: points a second": (500.0, "at least"),
    "slowest branch: points a second": (500.0, "at least"),
    "gradient of a relay's run, in runs": (5.0, "at most"),
}


def figures(section: dict[str, Any]) -> dict[str, float]:
    """Numbers to compare with TARGETS; scipy at its smallest tolerance, whose errors are larger."""
    found: dict[str, float] = {}
    if not section:
        return found
    for name, solvers in section["orbits"].items():
        peer = solvers[f"scipy DOP853, every state, {TOLERANCES[-1]:g}"]["seconds"]
        ours = solvers["nonsmooth"]["seconds"]
        for turns, of in (("", "median"), (", fastest turns", "low")):
            found[f"orbit {name}: times scipy, every state{turns}"] = peer[of] / ours[of]
    for name, pair in section["iterations"].items():
        ratio = pair["step"]["median"] / pair["period"]["median"]
        found[f"orbit {name}: step of Newton's method, in periods"] = ratio
    four = section["branches"]["forced friction, four legs"]
    found["branch of four legs: points a second"] = four["points"] / four["median"]
    rates = [branch["points"] / branch["median"] for branch in section["branches"].values()]
    found["slowest branch: points a second"] = min(rates)
    pair = section["gradients"]["relay, 15 events"]
    found["gradient of a relay's run, in runs"] = pair["gradient"]["median"] / pair["run"]["median"]
    return found


def markdown(section: dict[str, Any], table: Callable[[list[str], list[list[str]]], str]) -> str:
    """All of it as tables."""
    parts = []
    head = ["orbit", "solver", "ms", "spread", "times ours", "error of the orbit", "of multipliers"]
    rows = []
    for name, solvers in section["orbits"].items():
        own = solvers["nonsmooth"]["seconds"]["median"]
        for label, s in solvers.items():
            t = s["seconds"]
            spread = f"{t['low'] * 1e3:.3g} to {t['high'] * 1e3:.3g}"
            numbers = [f"{t['median'] * 1e3:.3g}", spread, f"{t['median'] / own:.3g}"]
            rows.append([name, label, *numbers, f"{s['orbit']:.1e}", f"{s['multipliers']:.1e}"])
    parts.append(table(head, rows))
    rows = [
        [name, f"{1e6 * s['step']['median']:.0f}", f"{1e6 * s['period']['median']:.0f}"]
        for name, s in section["iterations"].items()
    ]
    parts.append(table(["orbit", "step of Newton's method, us", "simulated period, us"], rows))
    rows = [
        [name, str(s["legs"]), str(s["points"]), f"{s['points'] / s['median']:.0f}"]
        for name, s in section["branches"].items()
    ]
    parts.append(table(["branch", "legs", "points", "points/s"], rows))
    rows = [
        [name, *(f"{1e6 * s[k]['median']:.0f}" for k in ("run", "gradient"))]
        for name, s in section["gradients"].items()
    ]
    parts.append(table(["gradient of", "run, us", "gradient, us"], rows))
    rows = [
        [name, f"{1e6 * s['median']:.0f}", f"{s['to compile']:.2g}"]
        for name, s in section["leg"]["solvers"].items()
    ]
    head = ["the walker's step with its 16 derivatives", "us", "s to compile"]
    return "\n\n".join([*parts, table(head, rows)])


def run(quick: bool) -> dict[str, Any]:
    """All of it."""
    result = {
        "orbits": orbits(quick),
        "iterations": iterations(quick),
        "branches": branches(quick),
        "gradients": gradients(quick),
        "leg": leg(quick),
    }
    print(f"  {result}", flush=True)
    return result
