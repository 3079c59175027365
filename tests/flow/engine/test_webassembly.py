"""The driver as WebAssembly gives the runs of the driver in C: same itineraries, same numbers."""

import ctypes
import hashlib
import importlib.util
import math

import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow.constants import KINDS
from nonsmooth.flow.engine.building import webassembly
from nonsmooth.flow.engine.image import image_of
from nonsmooth.flow.engine.interpreter import interpreter_for
from nonsmooth.flow.engine.structures import structure
from nonsmooth.flow.options import Options
from tests.flow.independent.hybrid import package_system
from tests.flow.random_systems import draw
from tests.node import case, runs

#: A relay, dry friction, impacts, sets, two surfaces, a forced one, hysteresis, resets, and implicit steps.
FEW = ("planar_relay", "dry_friction", "bouncing_ball", "block_on_belt", "multi_sliding_relay")
FEW += ("buck_converter", "gearbox", "impact_oscillator", "hidden_dynamics")


def stiff():
    import casadi as ca

    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    fast = -1e5 * (y - ca.cos(x))
    return ns.FilippovSystem([x, y], surface=x - 1, above=[-1, fast], below=[2, fast])


def tabulated():
    """Friction from a table: a sign, a kink and three breakpoints."""
    import casadi as ca

    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    speed = v - 0.3
    measured = ns.table(ca.fabs(speed), [0.0, 0.05, 0.1, 0.3, 1.0], [0.60, 0.45, 0.40, 0.36, 0.35])
    rates = [v, -x - measured * ca.sign(speed)]
    return ns.FilippovSystem.from_expression([x, v], rates)


def counted():
    """Discrete states that are counted up through values which Python shows with an exponent."""
    import casadi as ca

    x, small, large = (ca.SX.sym(name) for name in ("x", "small", "large"))
    tick = ns.Reset(ca.sin(x), {small: small / 10, large: 10.5 * large}, name="tick")
    return ns.FilippovSystem([x], field=[1], discrete=[small, large], resets=tick)


def textbook(name):
    problem = ns.textbook.PROBLEMS[name]()
    run = problem.run()
    return problem.system, run.x[0], float(run.t[-1]), run.parameters


def decided(events, t_end):
    """Times of events (time, kind) without the impacts that accumulate at a contact: rounding decides how many."""
    closings = [t for t, kind in events if kind == "contact"]
    return [
        t
        for t, kind in events
        if kind != "impact" or not any(0 <= own - t < 1e-3 * t_end for own in closings)
    ]


def difference(made, run, with_events=True):
    """What differs between a run of the module and one of Python, or an empty string."""
    if (made["status"], made["itinerary"]) != (int(run.status), run.itinerary):
        return f"{made['status']} {made['itinerary']}, not {run.status:d} {run.itinerary}"
    kinds = [KINDS[k] for k in made["eventKind"]]
    events = [(e.t, e.kind) for e in run.events if e.kind != "end"]
    both = events, [*zip(made["eventT"], kinds, strict=True)]
    times, own = (decided(each, run.t[-1]) if with_events else [] for each in both)
    if len(times) != len(own):
        return f"{len(own)} events, not {len(times)}"
    late = max(map(abs, np.subtract(own, times)), default=0.0)
    error = np.max(np.abs(run.x[-1] - made["x"]) / (1 + np.abs(run.x[-1])))
    worst = max(late, error, abs(made["t"] - run.t[-1]))
    return "" if worst <= 1e-9 else f"off by {worst:.2g}"


def wrong(cases):
    """Differences of the cases (system, start, end, parameters)."""
    made = runs([case(*one) for one in cases])
    found = []
    for (system, x, t_end, p), own in zip(cases, made, strict=True):
        run = ns.simulate(system, x, t_end, parameters=p)
        found.append(difference(own, run))
    return found


def test_the_shipped_module_is_that_of_the_present_sources():
    module = webassembly.MODULE.read_bytes()
    assert webassembly.has_module_key(module), "The driver has changed: run `make wasm`."


def test_comments_and_spaces_leave_the_key():
    text = "int a; /* one */ int b;"
    other = "int a;\n\n  /* two\n three */\nint b;"
    assert webassembly.key_of(text) == webassembly.key_of(other) != webassembly.key_of("int a;")


@pytest.mark.filterwarnings("ignore::nonsmooth.flow.warn.DecisionWarning")
def test_runs_are_python_s():
    cases = [textbook(name) for name in FEW]
    cases += [(stiff(), [0.0, 2.0], 3.0, None), (tabulated(), [0.0, 0.0], 20.0, None)]
    cases += [(counted(), [0.0, 1.0, 1.0], 30.0, None)]
    assert wrong(cases) == [""] * len(cases)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_two_hundred_runs_are_python_s():
    cases = [textbook(name) for name in ns.textbook.PROBLEMS if name != "slider_crank"]
    for seed in range(150):
        problem, _ = draw(seed)
        try:
            cases.append((package_system(problem), problem.start, problem.t_end, None))
        except (TypeError, ns.DefinitionError):
            continue
    found = wrong(cases)
    assert len(cases) >= 200 and found == [""] * len(cases)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_slider_crank_ends_as_python_s_with_as_many_impacts_as_rounding_decides():
    system, x, t_end, p = textbook("slider_crank")
    (made,) = runs([case(system, x, t_end, p)])
    assert difference(made, ns.simulate(system, x, t_end, parameters=p), with_events=False) == ""


def test_the_image_of_a_system_without_surfaces_parameters_and_events():
    import casadi as ca

    x = ca.SX.sym("x")
    system = ns.FilippovSystem([x], field=[-x])
    (made,) = runs([case(system, [1.0], 1.0)])
    assert made["x"] == pytest.approx([math.exp(-1)], abs=1e-12)
    assert made["itinerary"] == ns.simulate(system, [1.0], 1.0).itinerary


def test_the_layout_is_that_of_a_machine_of_32_bits():
    engine = interpreter_for(stiff(), Options(t_end=1.0))
    system, _ = engine.blocks()
    image = image_of(engine)
    own = structure("System", ctypes.c_uint32)
    assert ctypes.sizeof(own) < ctypes.sizeof(system) < len(image.bytes)
    assert all(at % 4 == 0 and at + 4 <= len(image.bytes) for at in image.addresses)
    assert len(set(image.addresses)) == len(image.addresses)


@pytest.mark.slow
@pytest.mark.skipif(not importlib.util.find_spec("ziglang"), reason="no ziglang (extra `compiler`)")
def test_the_module_is_compiled_again_to_the_same_bytes():
    again = hashlib.sha256(webassembly.compile_module()).hexdigest()
    assert again == hashlib.sha256(webassembly.MODULE.read_bytes()).hexdigest()
