"""A program generated for a system gives the same bits as the interpreter, and takes over unnoticed."""

import os
import pickle
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
import nonsmooth.flow.compiled.tape as tape_module
import nonsmooth.textbook as textbook
from nonsmooth.flow.compiled import find_compiler, tape_for
from nonsmooth.flow.compiled.building import background, build
from nonsmooth.flow.options import Options
from nonsmooth.flow.warn import CompilerWarning, warn_once
from tests.flow.compiled.test_tape import OPERATIONS, P

from ..independent.family import Size, draw, system, values

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

LOOSE = {"rtol": 1e-3, "atol": 1e-3}


def drivers(engine):
    """The interpreter, and the program of the engine's system."""
    engine._special.start()
    return tape_module.library(), engine._special.wait()


def contents(run):
    """Everything that a run or a chunk holds, as bytes."""
    arrays = run.arrays() if hasattr(run, "arrays") else vars(run)
    return {k: v.tobytes() for k, v in arrays.items() if isinstance(v, np.ndarray)}


def same(one, two):
    one, two = contents(one), contents(two)
    assert one.keys() == two.keys()
    assert [k for k in one if one[k] != two[k]] == []


def many(engine, x, p, options):
    """Runs by both drivers; the number of steps."""
    chunks = []
    for driver in drivers(engine):
        engine._driver = lambda steps, driver=driver: driver
        chunks.append(engine.run_many(x, p, options, None))
    del engine._driver
    same(*chunks)
    assert chunks[0].words == chunks[1].words
    assert chunks[0].totals.tolist() == chunks[1].totals.tolist()
    return int(chunks[0].totals[0])


def one(engine, x, p, options):
    """A dense run by both drivers."""
    runs = []
    for driver in drivers(engine):
        engine._driver = lambda steps, driver=driver: driver
        runs.append(engine.run(x, p, options))
    del engine._driver
    same(*runs)
    assert runs[0].status == runs[1].status and runs[0].itinerary == runs[1].itinerary
    return runs[0]


def every_operation():
    """All operations with coefficients of their own, in the field, the surfaces, a stop and a reset."""
    x, y, u, t = (ca.SX.sym(s) for s in "xyut")
    c, lam = ca.SX.sym("c", len(OPERATIONS)), ca.SX.sym("lam", 2)
    terms = [own(x, y) for own in OPERATIONS.values()]
    f = sum(c[k] * term for k, term in enumerate(terms))
    return ns.FilippovSystem(
        [x, y, u],
        field=[
            ca.cos(u + t) - x + 0.05 * ca.tanh(f),
            -0.2 * x - y - 0.3 * lam[1],
            0.4 * ca.sin(2 * t) - (0.8 + x * x) * lam[0],
        ],
        surfaces=[u - 0.3 * x * y, y - 0.1 * ca.sin(t)],
        multipliers=ca.vertsplit(lam),
        stops=[ns.Stop(f - 60)],
        resets=[ns.Reset(u - 1.5, [x, y, 1.0 + 0.1 * ca.tanh(x)], 1)],
        parameters=[*ca.vertsplit(c), P],
        time=t,
    )


def draws_of_operations(count, seed):
    rng = np.random.default_rng(seed)
    x = np.column_stack([rng.uniform(-0.5, 0.5, (count, 3)), np.zeros(count)])
    own = rng.normal(size=(count, len(OPERATIONS))) * (rng.random((count, len(OPERATIONS))) < 0.4)
    return x, np.column_stack([own, rng.uniform(-1.0, 1.0, count)])


@pytest.mark.slow
def test_all_operations_in_random_systems():
    made, options = every_operation(), Options(t_end=5.0, max_steps=500, **LOOSE)
    x, p = draws_of_operations(60, 1)
    engine = tape_for(made, options)
    assert many(engine, x, p, options) > 600
    one(engine, x[0], p[0], options)


def of_size(size, count, tol):
    rng = np.random.default_rng([size.n, size.m, count])
    drawn = [draw(size, rng) for _ in range(count)]
    x = np.array([[*d["x0"], 0.0] for d in drawn])
    options = Options(t_end=4.0, rtol=tol, atol=tol, max_steps=5000)
    return many(tape_for(system(size), options), x, np.array([values(d) for d in drawn]), options)


def test_a_few_random_systems():
    assert of_size(Size(3, 2), 40, 1e-4) > 800


@pytest.mark.slow
@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_10000_random_systems(n):
    tolerances = {1: 1e-10, 2: 1e-6, 3: 1e-3}
    assert sum(of_size(Size(n, m), 600, tol) for m, tol in tolerances.items()) > 20_000
    made, options = every_operation(), Options(t_end=5.0, max_steps=500, **LOOSE)
    many(tape_for(made, options), *draws_of_operations(700, n), options)


def test_terms_that_a_mode_leaves_out():
    """Beside what slides and what does not; functions of the other sides have no values on the way."""
    x, z, w = (ca.SX.sym(s) for s in "xzw")
    grows = ca.sign(x) * ca.sqrt(0.01 + ca.fabs(x))
    empties = -ca.if_else(z > 0.25, ca.sqrt(z), 0.5)
    made = ns.FilippovSystem.from_expression([x, z, w], [grows, empties, -ca.sign(w)])
    options = Options(t_end=3.0)
    engine, start = tape_for(made, options), np.array([[0.005, 1.0, 0.5], [-0.005, 0.8, -0.1]])
    many(engine, start, np.zeros(0), options)
    run = one(engine, start[0], np.zeros(0), options)
    exact = [(np.sqrt(0.015) + 1.5) ** 2 - 0.01, 0.25 - 0.5 * 2.0, 0.0]
    assert run.status == ns.Status.REACHED_END and run.t[-1] == 3.0
    np.testing.assert_allclose(run.x[-1, :3], exact, atol=1e-9)


def test_quotients_whose_divisors_overflow():
    """Friction 2/(1 + exp(-v/e)) - 1 = tanh(v/2e) at speeds of 900 e, where exp is infinite or nearly."""
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    width, options = 1e-2, Options(t_end=12.0)
    friction = ca.tanh(v / (2 * width))
    forms = [2 / (1 + ca.exp(-v / width)) - 1, 2 * (1 + ca.exp(-v / width)) ** -1.0 - 1]
    forms.append(2 / (1 + ca.exp(-v / width / 2) ** 2) - 1)
    exact = ns.simulate(
        ns.FilippovSystem([x, v], field=[v, -x - 0.4 * friction]), [-10.0, 0.0], 12.0
    )
    for form in forms:
        engine = tape_for(ns.FilippovSystem([x, v], field=[v, -x - 0.4 * form]), options)
        run = one(engine, np.array([-10.0, 0.0]), np.zeros(0), options)
        assert run.status == ns.Status.REACHED_END and len(run.t) < 200
        np.testing.assert_allclose(run.x[-1], exact.x[-1], atol=1e-8)


def bouncing():
    """A ball with friction that lands, slides, sticks and rests."""
    x, y, v, w, lam = (ca.SX.sym(s) for s in ("x", "y", "v", "w", "lam"))
    force = ca.SX.sym("N")
    return ns.FilippovSystem(
        [x, y, v, w],
        field=[v, w, 0.2 - 0.3 * lam * force, -1.0 + force],
        surfaces=[v],
        multipliers=[lam],
        impacts=[ns.Impact(y, 0.5, force, "ground")],
    )


@pytest.mark.slow
def test_impacts_and_contacts():
    made = bouncing()
    options = Options(t_end=6.0, **LOOSE)
    for start in ([0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.5, 0.0]):
        run = one(tape_for(made, options), np.array(start), np.zeros(0), options)
        assert "c" in run.itinerary


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(textbook.PROBLEMS))
def test_textbook(name):
    problem = textbook.by_name(name)
    options = Options(t_end=problem.t_end)
    engine = tape_for(problem.system, options)
    if engine is None:
        pytest.skip("it has no program")
    x = problem.system.extended_point(problem.start, 0.0)
    one(engine, x, problem.system.parameter_vector(problem.parameters), options)


# taking over ------------------------------------------------------------------------------------


def oscillator(friction=0.4):
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    slow, fast = [v, -x - friction], [v, -x + friction]
    return ns.FilippovSystem([x, v], surface=v - 0.3, above=slow, below=fast)


@pytest.mark.slow
def test_the_run_goes_on_in_the_program_from_any_step(monkeypatch):
    options = Options(t_end=60.0, **LOOSE)
    engine = tape_for(oscillator(), options)
    x, p = np.array([1.0, 0.2]), np.zeros(0)
    alone = one(engine, x, p, options)
    monkeypatch.setattr(tape_module, "BURST", 1)
    for seed in range(3):
        rng, both = np.random.default_rng(seed), drivers(engine)
        engine._driver = lambda steps, rng=rng, both=both: both[rng.integers(2)]
        same(engine.run(x, p, options), alone)


#: What the compiler below made, by its text.
MADE = {}


@pytest.fixture
def compiler(tmp_path, monkeypatch):
    """A compiler that waits until it is let go, and knows whether it began; the interpreter is there.
    It does not optimise, which has no say in the bits, compiles a text once, and does nothing for a
    test that is over."""
    tape_module.library()
    real, go, began = build.Compilation.call, threading.Event(), threading.Event()
    over = threading.Event()

    def call(self, command):
        began.set()
        if self.quiet:
            go.wait(60.0)
        if over.is_set():
            self.stop()
        *_, text, _, output, _ = map(Path, command)
        source = text.read_bytes()
        if source in MADE and not self.stopped:
            output.write_bytes(MADE[source])
            return ""
        failure = real(self, [*command, "-O0"])
        if not failure:
            MADE[source] = output.read_bytes()
        return failure

    monkeypatch.setattr(build.Compilation, "call", call)
    monkeypatch.setenv("NONSMOOTH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(tape_module, "_LONG", 100)
    monkeypatch.setattr(tape_module, "BURST", 16)
    warn_once.cache_clear()
    yield go, began
    over.set()
    go.set()


@pytest.mark.slow
def test_a_long_run_does_not_wait_and_nobody_can_tell(compiler):
    go, began = compiler
    made = oscillator()
    first = ns.simulate(made, [1.0, 0.2], 200.0, tol=1e-3)
    assert began.wait(60.0) and not go.is_set()
    go.set()
    engine = tape_for(made, Options(t_end=1.0, **LOOSE))
    engine._special.wait()
    assert engine._driver(0) is not tape_module.library()
    again = ns.simulate(made, [1.0, 0.2], 200.0, tol=1e-3)
    assert first.x.tobytes() == again.x.tobytes() and first.t.tobytes() == again.t.tobytes()
    assert first.steps.coefficients.tobytes() == again.steps.coefficients.tobytes()


def test_a_system_is_pickled_while_its_program_is_compiled(compiler):
    made = oscillator()
    first = ns.simulate(made, [1.0, 0.2], 200.0, tol=1e-3)
    assert compiler[1].wait(60.0)
    copy = ns.simulate(pickle.loads(pickle.dumps(made)), [1.0, 0.2], 200.0, tol=1e-3)
    assert first.x.tobytes() == copy.x.tobytes()


def test_threads_share_one_compilation(compiler):
    made = oscillator()
    starts = np.random.default_rng(0).normal(size=(40, 2))
    work = lambda threads: ns.Work(threads=threads, chunk=4, progress=False)
    results = [
        ns.ensemble(made, starts, 50.0, tol=1e-3, t_eval=[1.0, 40.0], work=work(k)) for k in (1, 3)
    ]
    compiler[0].set()
    results.append(ns.ensemble(made, starts, 50.0, tol=1e-3, t_eval=[1.0, 40.0], work=work(3)))
    assert len({many.x.tobytes() for many in results}) == 1
    assert len({many.sample_x.tobytes() for many in results}) == 1


def test_a_compiler_that_fails_meanwhile_is_told_once_and_the_run_goes_on(compiler, monkeypatch):
    monkeypatch.setattr(build.Compilation, "call", lambda self, command: "no room\nat all")
    made = oscillator()
    expected = ns.simulate(oscillator(), [1.0, 0.2], 5.0, tol=1e-3)
    with pytest.warns(CompilerWarning, match="no room") as told:
        ns.simulate(made, [1.0, 0.2], 200.0, tol=1e-3)
        tape_for(made, Options(t_end=1.0, **LOOSE))._special._thread.join()
        for _ in range(3):
            run = ns.simulate(made, [1.0, 0.2], 5.0, tol=1e-3)
    assert len(told) == 1 and run.x.tobytes() == expected.x.tobytes()


@pytest.mark.slow
def test_an_interrupt_leaves_the_compilation_alone(compiler, monkeypatch):
    made, library = oscillator(), tape_module.library()
    original, engine = library.run_continue, tape_for(made, Options(t_end=1.0, **LOOSE))

    def interrupted(state, budget):
        if engine._special._thread is not None:
            raise KeyboardInterrupt
        return original(state, budget)

    monkeypatch.setattr(library, "run_continue", interrupted)
    with pytest.raises(KeyboardInterrupt):
        ns.simulate(made, [1.0, 0.2], 200.0, tol=1e-3)
    monkeypatch.undo()
    compiler[0].set()
    engine._special.wait()
    assert engine._special.library() is not None


def test_stopping_ends_the_compiler_and_what_it_has_written(tmp_path, monkeypatch):
    monkeypatch.setenv("NONSMOOTH_CACHE", str(tmp_path / "cache"))
    stub = tmp_path / "cc"
    stub.write_text("#!/bin/sh\nexec sleep 600\n")
    stub.chmod(0o755)
    monkeypatch.setenv("CC", str(stub))
    job = background.Background(lambda: "int answer(void) { return 42; }\n", lambda found: found)
    job.start()
    while job._run._process is None:
        time.sleep(0.01)
    job.stop()
    assert not job._thread.is_alive() and job._run._process.poll() is not None
    assert list((tmp_path / "cache").iterdir()) == [] and job.library() is None


EXIT = """
import casadi as ca, nonsmooth as ns
import nonsmooth.flow.compiled.tape as tape
tape.library()
import os
os.environ["CC"] = {stub!r}
tape._LONG = tape.BURST = 64
x, v = ca.SX.sym("x"), ca.SX.sym("v")
made = ns.FilippovSystem([x, v], surface=v - 0.3, above=[v, -x - 0.4], below=[v, -x + 0.4])
ns.simulate(made, [1.0, 0.2], 500.0)
if {fork}:
    child = os.fork()
    if child == 0:
        ns.simulate(made, [1.0, 0.2], 5.0)
        raise SystemExit
    assert os.waitpid(child, 0)[1] == 0
print("done")
"""


@pytest.mark.parametrize("fork", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_program_ends_while_the_compiler_works(fork, tmp_path):
    stub = tmp_path / "slow"
    stub.write_text("#!/bin/sh\nexec sleep 600\n")
    stub.chmod(0o755)
    path = os.pathsep.join(p for p in sys.path if p)
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(EXIT).format(stub=str(stub), fork=fork)],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0 and done.stderr == "" and "done" in done.stdout, done.stderr
