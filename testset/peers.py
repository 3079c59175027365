"""Other tools on a problem: each from the mode of a problem to one leg of its motion."""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from nonsmooth.model.expressions.float_arithmetic import BINARY, UNARY
from nonsmooth.model.expressions.graph import instructions

from .modes import SECONDS, GaveUp, Modes, NotForModes, Solver

#: The tolerance of all, and steps at least in a whole run, as events are seen at the ends of steps.
TOL, LONGEST = 1e-10, 200
NEAR, NUDGE = 1e-13, 1e-15


def numbers(x: ca.SX, t: ca.SX, e: ca.SX) -> Any:
    """A function f(t, x) of floats, which ends after a time."""
    f, begin = ca.Function("f", [x, t], [ca.densify(e)]), []
    n, m = x.numel(), e.numel()
    buffer, run = f.buffer()
    state, now, out = np.empty(n), np.empty(1), np.empty(m)
    buffer.set_arg(0, memoryview(state))
    buffer.set_arg(1, memoryview(now))
    buffer.set_res(0, memoryview(out))

    def values(t: float, x: np.ndarray) -> np.ndarray:
        begin.append(time.process_time()) if not begin else None
        if time.process_time() - begin[0] > SECONDS:
            raise GaveUp(f"{SECONDS:.0f} s")
        state[:], now[0] = x, t
        run(), buffer, f  # kept: the buffer does not keep its function, nor `run` the buffer
        return out.copy()

    return values


def symbols(x: ca.SX, t: ca.SX, e: ca.SX, library: Any) -> Any:
    """The same function of another library's numbers or symbols."""
    nodes, rows = instructions([x, t], [ca.densify(e)])
    inverse = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}
    special = {
        "sq": lambda a: a * a,
        "inv": lambda a: 1.0 / a,
        "twice": lambda a: a + a,
        "assign": lambda a: a,
        "pow": lambda a, b: a**b,
        "constpow": lambda a, b: a**b,
    }

    def values(t: Any, x: Any) -> list[Any]:
        found: list[Any] = []
        for node in nodes:
            args = [found[a] for a in node.args]
            if node.op == "const":
                found.append(node.payload)
            elif node.op == "input":
                found.append(t if node.source[0] else x[node.source[1]])
            elif node.op in special:
                found.append(special[node.op](*args))
            elif node.op in ("neg", "add", "sub", "mul", "div") or all(
                isinstance(a, float) for a in args
            ):
                found.append({**UNARY, **BINARY}[node.op](*args))
            else:
                name = node.op if hasattr(library, node.op) else inverse[node.op]
                found.append(getattr(library, name)(*args))
        return [found[k] for k in rows[0]]

    return values


def scipy(x: ca.SX, t: ca.SX, field: ca.SX, guards: ca.SX) -> Any:
    """solve_ivp with DOP853 and terminal events."""
    from scipy.integrate import solve_ivp

    rhs, values = numbers(x, t, field), numbers(x, t, guards)
    events = []
    for k in range(guards.numel()):
        events.append(lambda t, x, k=k: values(t, x)[k])
        events[-1].terminal, events[-1].direction = True, -1

    def leg(t: float, x: np.ndarray, t_end: float) -> Any:
        if t >= t_end:
            return t, x, None
        longest = t_end / LONGEST
        run = solve_ivp(
            rhs, (t, t_end), x, "DOP853", events=events, rtol=TOL, atol=TOL, max_step=longest
        )
        if run.status < 0:
            raise GaveUp(run.message)
        hit = next((k for k in range(len(events)) if len(run.t_events[k])), None)
        return run.t[-1], run.y[:, -1], hit

    return leg


def sksundae(x: ca.SX, t: ca.SX, field: ca.SX, guards: ca.SX) -> Any:
    """CVODE (BDF) with its root finding."""
    from sksundae.cvode import CVODE

    rhs, values = numbers(x, t, field), numbers(x, t, guards)

    def right(t: float, y: np.ndarray, out: np.ndarray) -> None:
        out[:] = rhs(t, y)

    def events(t: float, y: np.ndarray, out: np.ndarray) -> None:
        out[:] = values(t, y)

    m = guards.numel()
    given = {}
    if m:
        events.terminal, events.direction = [True] * m, [-1] * m  # type: ignore[attr-defined]
        given = dict(eventsfn=events, num_events=m)

    def leg(t: float, x: np.ndarray, t_end: float) -> Any:
        if t >= t_end:
            return t, x, None
        run = CVODE(
            right, rtol=TOL, atol=TOL, max_num_steps=200_000, max_step=t_end / LONGEST, **given
        ).solve([t, t_end], x)
        if not run.success:
            raise GaveUp(run.message)
        if m and run.t_events is not None and len(run.t_events):
            hit = np.flatnonzero(np.asarray(run.i_events[-1]))
            return run.t_events[-1], run.y_events[-1], int(hit[0])
        return run.t[-1], run.y[-1], None

    return leg


def heyoka(x: ca.SX, t: ca.SX, field: ca.SX, guards: ca.SX) -> Any:
    """taylor_adaptive with terminal events; a start on a guard is pushed off it, where it would hide the next root."""
    import heyoka as hy

    names = (
        list(hy.make_vars(*[f"x{i}" for i in range(x.numel())]))
        if x.numel() > 1
        else [hy.make_vars("x0")]
    )
    right = symbols(x, t, field, hy)(hy.time, names)
    rows = symbols(x, t, guards, hy)(hy.time, names) if guards.numel() else []
    fall = hy.event_direction.negative
    events = [hy.t_event(hy.expression(0.0) + row, direction=fall) for row in rows]
    equations = [(s, hy.expression(0.0) + f) for s, f in zip(names, right, strict=True)]
    taylor = hy.taylor_adaptive(equations, [0.1] * len(names), t_events=events, tol=1e-12)

    normals = ca.jacobian(guards, x)
    outputs = (guards, normals @ field + ca.jacobian(guards, t), normals)
    at = ca.Function("g", [x, t], [ca.densify(e) for e in outputs])

    def leg(t: float, x: np.ndarray, t_end: float) -> Any:
        if events:
            on, rates, normals = (np.array(v) for v in at.call([x, t]))
            for value, rate, normal in zip(on.ravel(), rates.ravel(), normals, strict=True):
                if abs(value) < NEAR and rate > 0 and np.any(normal):
                    x = x + (NUDGE - value) * normal / (normal @ normal)
        taylor.time, taylor.state[:] = t, x
        if events:
            taylor.reset_cooldowns()
        outcome = taylor.propagate_until(t_end, max_steps=200_000)[0]
        if outcome == hy.taylor_outcome.time_limit:
            return taylor.time, taylor.state.copy(), None
        hit = -int(outcome) - 1
        if not 0 <= hit < len(events):
            raise GaveUp(str(outcome))
        return taylor.time, taylor.state.copy(), hit

    return leg


def diffrax(x: ca.SX, t: ca.SX, field: ca.SX, guards: ca.SX) -> Any:
    """diffeqsolve with Dopri8 and events with a root finder."""
    import diffrax as dx
    import jax
    import jax.numpy as jnp
    import optimistix

    jax.config.update("jax_enable_x64", True)
    right, rows = symbols(x, t, field, jnp), symbols(x, t, guards, jnp)
    m = guards.numel()
    term = dx.ODETerm(lambda t, y, _: jnp.stack([v + 0.0 * y[0] for v in right(t, y)]))
    made = [lambda t, y, args, k=k, **_: rows(t, y)[k] for k in range(m)]
    event = dx.Event(made, optimistix.Newton(TOL, TOL), direction=[False] * m) if m else None

    @jax.jit
    def solve(t: Any, x: Any, t_end: Any) -> Any:
        control = dx.PIDController(rtol=TOL, atol=TOL, dtmax=t_end / LONGEST)
        return dx.diffeqsolve(
            term,
            dx.Dopri8(),
            t,
            t_end,
            None,
            x,
            event=event,
            stepsize_controller=control,
            max_steps=100_000,
            throw=False,
        )

    solve = solve.lower(0.0, jnp.zeros(x.numel()), 1.0).compile()

    def leg(t: float, x: np.ndarray, t_end: float) -> Any:
        if t >= t_end:
            return t, x, None
        run = solve(t, jnp.asarray(x), t_end)
        hit = [k for k in range(m) if bool(run.event_mask[k])]
        if not hit and run.result != dx.RESULTS.successful:
            raise GaveUp(str(run.result)[:60])
        return float(run.ts[-1]), np.array(run.ys[-1]), hit[0] if hit else None

    return leg


def pathsim(x: ca.SX, t: ca.SX, field: ca.SX, guards: ca.SX) -> Any:
    """An ODE block, RKDP87, and zero-crossing events that stop the simulation."""
    from pathsim import Simulation
    from pathsim.blocks import ODE
    from pathsim.events import ZeroCrossingDown
    from pathsim.solvers import RKDP87

    rhs, values = numbers(x, t, field), numbers(x, t, guards)

    def leg(t: float, x: np.ndarray, t_end: float) -> Any:
        if t >= t_end:
            return t, x, None
        block, hits = ODE(lambda x, u, s: rhs(t + s, x), np.array(x)), list[Any]()

        def act(k: int) -> Any:
            def stop(s: float) -> None:
                hits.append((t + s, block.engine.state.copy(), k))
                simulation.stop()

            return stop

        events = [
            ZeroCrossingDown(lambda s, k=k: values(t + s, block.engine.state)[k], act(k), 1e-10)
            for k in range(guards.numel())
        ]
        simulation = Simulation(
            [block],
            [],
            events,
            dt=1e-3,
            dt_max=t_end / LONGEST,
            Solver=RKDP87,
            log=False,
            tolerance_lte_abs=TOL,
            tolerance_lte_rel=TOL,
        )
        simulation.run(t_end - t, reset=False, adaptive=True)
        return hits[0] if hits else (t_end, block.engine.state.copy(), None)

    return leg


def jaxonomy(x: ca.SX, t: ca.SX, field: ca.SX, guards: ca.SX) -> Any:
    """A LeafSystem with terminal zero crossings, Dopri5, in major steps."""
    import jax.numpy as jnp
    from jaxonomy import LeafSystem, SimulatorOptions
    from jaxonomy.simulation import Simulator

    right, rows = symbols(x, t, field, jnp), symbols(x, t, guards, jnp)
    system, n = LeafSystem(), x.numel()
    rate = lambda t, state: jnp.stack([v + 0.0 * t for v in right(t, state.continuous_state)])
    system.declare_continuous_state(default_value=jnp.zeros(n), ode=rate)
    for k in range(guards.numel()):
        value = lambda t, state, k=k: rows(t, state.continuous_state)[k]
        system.declare_zero_crossing(value, direction="positive_then_non_positive", terminal=True)
    options = SimulatorOptions(rtol=TOL, atol=TOL, precision="float64", ode_solver_method="dopri5")
    simulator = Simulator(system, options=options)
    first = system.create_context()
    simulator.advance_to(1e-3, first)  # compiles

    def leg(t: float, x: np.ndarray, t_end: float) -> Any:
        begin, context = time.process_time(), first.with_continuous_state(jnp.asarray(x))
        while t < t_end:
            ahead = min(t + t_end / LONGEST, t_end)
            context = simulator.advance_to(ahead, context.with_time(t)).context
            t, x = float(context.time), np.array(context.continuous_state)
            if time.process_time() - begin > SECONDS:
                raise GaveUp(f"{SECONDS:.0f} s")
            if t < ahead - 1e-12:
                return t, x, int(np.argmin(np.abs([float(v) for v in rows(t, x)])))
        return t_end, x, None

    return leg


def _require_relays(d: Any) -> None:
    """Refuse problems that have more than signs of switching functions."""
    if d.guards.numel() or d.gaps.numel() or not d.multipliers.numel() or not d.plain:
        raise NotForModes("events beside relays, or no relay")
    if d.laws or d.complementarity or d.constraints:
        raise NotForModes("more than relays")


def siconos(problem: Any) -> np.ndarray:
    """Time stepping of relays by EulerMoreauOSI with 20,000 steps: first order, of linear systems."""
    import siconos.kernel as sk

    d = problem.system.definition
    _require_relays(d)
    if d.time.numel():
        raise NotForModes("depends on time")
    x, lam, p = d.states, d.multipliers, list(d.defaults.values())
    parts = [ca.jacobian(d.field, x), ca.jacobian(d.field, lam), ca.jacobian(d.surfaces, x)]
    zero = lambda e: ca.substitute(e, ca.vertcat(x, lam), ca.SX.zeros(x.numel() + lam.numel(), 1))
    offset = ca.Function("o", [d.parameters], [zero(d.field), zero(d.surfaces)])
    if any(ca.depends_on(part, ca.vertcat(x, lam)) for part in parts):
        raise NotForModes("not linear")
    A, B, C = (np.array(ca.DM(v)) for v in ca.Function("m", [d.parameters], parts).call([p]))
    b, e = (np.array(ca.DM(v)).ravel() for v in offset.call([p]))
    block = sk.FirstOrderLinearTIDS(problem.start, A, b)
    relation = sk.FirstOrderLinearTIR(C, -B)
    relation.setePtr(e)
    contact = sk.Interaction(sk.RelayNSL(len(e), -1.0, 1.0), relation)
    model = sk.NonSmoothDynamicalSystem(0.0, problem.t_end)
    model.insertDynamicalSystem(block)
    model.link(contact, block)
    grid = sk.TimeDiscretisation(0.0, problem.t_end / 20_000)
    steps = sk.TimeStepping(model, grid, sk.EulerMoreauOSI(0.5), sk.Relay())
    while steps.hasNextEvent():
        steps.computeOneStep()
        steps.nextStep()
    return np.array(block.x())


def solve_nivp(problem: Any) -> np.ndarray:
    """Composite steps (trapezoidal, backward Euler) with a projection on [-1, 1], 500 of them."""
    from solve_nivp import solve_ivp_ns

    d = problem.system.definition
    _require_relays(d)
    n, m, time_ = (
        d.states.numel(),
        d.multipliers.numel(),
        d.time if d.time.numel() else ca.SX.sym("t"),
    )
    signal, values = ca.SX.sym("s", m), ca.vertcat(*d.defaults.values())
    read = lambda e: ca.substitute(e, d.parameters, values) if d.parameters.numel() else e
    y = ca.vertcat(d.states, signal, d.multipliers)  # states, their switching functions, signs
    right = ca.vertcat(read(d.field), read(d.surfaces) - signal, ca.SX.zeros(m, 1))
    slopes, jacobian = numbers(y, time_, ca.vec(ca.jacobian(right, y))), y.numel()
    height = ca.Function("h", [d.states, time_], [read(d.surfaces)])
    h0 = np.array(height(problem.start, 0.0)).ravel()
    _, found, *_, info = solve_ivp_ns(
        numbers(y, time_, right),
        (0.0, problem.t_end),
        np.concatenate([problem.start, h0, np.sign(h0)]),
        projection="sign",
        projection_opts=dict(y_indices=[*range(n, n + m)], w_indices=[*range(n + m, n + 2 * m)]),
        solver="semismooth_newton",
        solver_opts=dict(tol=TOL, rhs_jac=lambda t, v: slopes(t, v).reshape(jacobian, -1).T),
        adaptive=False,
        h0=problem.t_end / 500,
        A=np.diag([1.0] * n + [0.0] * 2 * m),
    )
    if not all(done for _, done, _ in info[1:]):
        raise GaveUp("a step did not converge")
    return found[-1, :n]


def by_hand(solver: Solver, written: bool = False) -> Callable[[Any], np.ndarray]:
    """The end of a problem by modes and guards."""

    def end(problem: Any) -> np.ndarray:
        d = problem.system.definition
        t, x = Modes(d, solver, written).run(np.array(problem.start), problem.t_end)
        if not math.isclose(t, problem.t_end, rel_tol=1e-9) and not d.stops:
            raise GaveUp(f"ended at {t}")
        return x

    return end


#: Name in the table, module, and the end of a problem.
PEERS: dict[str, tuple[str, Callable[[Any], np.ndarray]]] = {
    "scipy, sign in the field": ("scipy", by_hand(scipy, True)),
    "scipy, modes by hand": ("scipy", by_hand(scipy)),
    "CVODE, modes by hand": ("sksundae", by_hand(sksundae)),
    "heyoka, modes by hand": ("heyoka", by_hand(heyoka)),
    "diffrax, modes by hand": ("diffrax", by_hand(diffrax)),
    "PathSim, sign in the field": ("pathsim", by_hand(pathsim, True)),
    "PathSim, modes by hand": ("pathsim", by_hand(pathsim)),
    "jaxonomy, modes by hand": ("jaxonomy", by_hand(jaxonomy)),
    "Siconos, 20,000 time steps": ("siconos", siconos),
    "solve-nivp, 500 time steps": ("solve_nivp", solve_nivp),
}


def installed(module: str) -> bool:
    """Whether a tool is there."""
    return importlib.util.find_spec(module) is not None
