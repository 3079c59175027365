"""What NVRTC makes of the kernels, run on this processor instruction by instruction, is what the shim computes: the same
bits where nothing is fused."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
import nonsmooth.textbook as textbook
from benchmarks.problems import bounce_system, random_starts
from nonsmooth.flow.compiled import find_compiler
from nonsmooth.flow.compiled.device.shim import Shim
from nonsmooth.flow.ensembles import on_device
from nonsmooth.flow.options import Options
from nonsmooth.flow.status import Status
from tests.flow.compiled.device.cases import TAKEN, block_on_a_belt, ends
from tests.flow.compiled.device.nvrtc import library
from tests.flow.compiled.device.ptx import Interpreted, translated

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(library() is None, reason="no NVRTC: pip install nvidia-cuda-nvrtc"),
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
]

STARTS = np.random.default_rng(3).normal(size=(300, 2)) * 0.8


def same_bits(one, two):
    for name in ("x", "t", "status", "kinds", "at_x", "at_t"):
        if getattr(one, name) is not None:
            assert np.array_equal(getattr(one, name), getattr(two, name), equal_nan=True), name
    assert words(one) == words(two)


def words(chunk):
    return [chunk.words[k] for k in chunk.itinerary]


@pytest.mark.parametrize("own", [False, True])
def test_same_bits(own):
    """With events kept, with parameters of each start, with starts that are not numbers."""
    system, x = block_on_a_belt(), STARTS.copy()
    x[5], x[6] = np.nan, np.inf
    p = system.parameter_vector() * (np.linspace(0.5, 1.5, len(x))[:, None] if own else 1)
    options = Options(t_end=3.0, rtol=1e-5, atol=1e-5, max_events=4)
    found = [
        ends(machine, system, x, options, p, at=(1, 1))
        for machine in (Interpreted(fused=False), Shim(fused=False))
    ]
    same_bits(*found)
    assert {Status.STOPPED, Status.REACHED_END, Status.NOT_FINITE} <= set(found[0].status.tolist())


@pytest.mark.parametrize(
    "starts",
    [
        STARTS[:60],
        ns.Grid([0.25, np.linspace(-1, 1, 9)]),
        ns.RandomStarts(70, [-1.0, -0.3], [0.7, 0.1], seed=2**64 - 3),
    ],
)
def test_ensembles_and_outcomes(starts, monkeypatch):
    """All kernels, as ``device="cuda"`` calls them: starts made there, results reduced there."""
    system, found = block_on_a_belt(), []
    for machine in (Interpreted(fused=False, blocks=3, threads=2), Shim(fused=False)):
        monkeypatch.setattr(on_device, "machine_for", lambda device, machine=machine: machine)
        options = dict(t_end=3.0, tol=1e-6, device="cuda", work=ns.Work(chunk=25))
        runs = ns.ensemble(system, starts, **options)
        count = ns.outcomes(system, starts, ranges={"x": (-1, 1)}, bins=5, **options)
        found.append((runs, count))
    (one, counted), (two, other) = found
    assert np.array_equal(one.x, two.x) and np.array_equal(one.itinerary, two.itinerary)
    assert counted.itineraries == other.itineraries and counted.status == other.status
    assert counted.histogram["x"].tolist() == other.histogram["x"].tolist()
    assert counted.mean == pytest.approx(other.mean, rel=1e-15, abs=1e-15)


@pytest.mark.parametrize("name", ["linear", "nonlinear"])
def test_bounces(name):
    """Fused, what the assembler gets differs from the shim by rounding only."""
    system, x, options = bounce_system(name), random_starts(3000, seed=6), Options(t_end=100.0)
    plain, shim, fused = (
        ends(machine, system, x, options)
        for machine in (Interpreted(fused=False), Shim(fused=False), Interpreted())
    )
    same_bits(plain, shim)
    assert np.array_equal(fused.status, shim.status) and words(fused) == words(shim)
    done = np.isfinite(shim.t)
    np.testing.assert_allclose(fused.x[done], shim.x[done], rtol=0, atol=1e-14)
    np.testing.assert_allclose(fused.t[done], shim.t[done], rtol=0, atol=1e-14)


SMOOTH = {
    "sin": lambda x, y: ca.sin(1e3 * x) + ca.cos(x) + ca.tan(y / 3),
    "exp": lambda x, y: ca.exp(y) + ca.log(2 + x * x) + ca.expm1(x) + ca.log1p(y * y),
    "pow": lambda x, y: ca.power(2.5 + x * x, y) + ca.hypot(1 + x, 2 + y) + ca.sqrt(3 + x * x),
    "tanh": lambda x, y: ca.tanh(x) + ca.sinh(x / 3) + ca.cosh(y / 3) + ca.erf(y),
    "atan": lambda x, y: ca.atan(x) + ca.atan2(x, 2 + y * y) + ca.asin(ca.sin(x) / 2),
    "atanh": lambda x, y: ca.atanh(ca.sin(x) / 2) + ca.asinh(y) + ca.acosh(3 + x * x),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_functions_of_the_card(name):
    """CUDA's own functions, whose last bits are others: states to the tolerance of rounding, itineraries equal."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    f = SMOOTH[name](x, y) / 9
    system = ns.FilippovSystem([x, y], surface=y, above=[y, -x - f], below=[y, 1 - x + f])
    options = Options(t_end=2.0, rtol=1e-7, atol=1e-7)
    one, two = (ends(m, system, STARTS, options) for m in (Interpreted(), Shim()))
    assert np.array_equal(one.status, two.status) and words(one) == words(two)
    done = one.status == Status.REACHED_END
    assert done.mean() > 0.5
    np.testing.assert_allclose(one.x[done], two.x[done], rtol=0, atol=1e-11)


#: Problems whose fields have a cosine: CUDA's own has other last bits.
FORCED = {"belt_oscillator", "forced_dry_friction"}


@pytest.mark.parametrize("name", TAKEN)
def test_textbook_problems(name):
    problem = textbook.by_name(name)
    scale = 0.1 * (1 + np.abs(problem.start))
    x = problem.start + scale * np.random.default_rng(1).normal(size=(64, len(problem.start)))
    p = problem.system.parameter_vector(problem.parameters)
    options = Options(t_end=min(problem.t_end, 20.0), rtol=1e-8, atol=1e-8, max_steps=3000)
    machines = Interpreted(fused=False), Shim(fused=False)
    one, two = (ends(m, problem.system, x, options, p) for m in machines)
    if name not in FORCED:
        return same_bits(one, two)
    assert np.array_equal(one.status, two.status) and words(one) == words(two)
    np.testing.assert_allclose(one.x, two.x, rtol=0, atol=1e-12)


def test_what_is_not_known_is_refused():
    text = ".visible .entry f(.param .u64 f_param_0)\n{\n\tbar.sync 0;\n\tret;\n}\n"
    with pytest.raises(AssertionError, match="bar"):
        translated(text)
