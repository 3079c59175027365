"""Every operation of CasADi's SX has the value of mpmath, alone and in lanes, or is refused by name."""

from functools import cache
from itertools import chain

import casadi as ca
import mpmath
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.model.expressions.float_arithmetic import BINARY, UNARY
from nonsmooth.model.expressions.graph import NOT_SMOOTH, operation
from tests.proofs.random_graphs import Exact

x, y, p, q = (ca.SX.sym(s) for s in "xypq")
T_END = 0.25
#: Starts of the arguments x0 + t and y0 + t, at which most operations are defined.
START, ELSEWHERE = (0.3, 0.4), {"acosh": (1.3, 0.4)}


def nodes_of(code):
    """What SX makes of an operation's code with one and two arguments, where it is a node of its own."""
    found = ca.SX.unary(code, x), ca.SX.binary(code, x, y)
    return [e for e in found if e.op() == code]


SX = {n[3:].lower(): getattr(ca, n) for n in dir(ca) if n.startswith("OP_")}
SX = {name: code for name, code in SX.items() if nodes_of(code)}
SMOOTH = [op for op in (*UNARY, *BINARY) if op not in NOT_SMOOTH and op != "assign"]
PROVEN = {"fabs", "fmin", "fmax"}  # of constants: the other kinks jump somewhere


def of(op, *args):
    return operation(op, args[: 1 if op in UNARY else 2])


def test_every_operation_of_casadi_is_known():
    """A new operation of a new CasADi has to get its rules, or a refusal."""
    assert set(SX) - {"printme", "const"} | {"constpow"} == {*UNARY, *BINARY} - {"assign"}


@cache
def integral(op):
    """The integral of an operation along x0 + t, y0 + t."""
    start = ELSEWHERE.get(op, START)
    with mpmath.workdps(30):
        value = lambda t: Exact(None).apply(
            op, [mpmath.mpf(a) + t for a in start][: 1 + (op in BINARY)]
        )
        return float(mpmath.quad(value, [0, T_END]))


@cache
def moving():
    """All smooth operations of states at once, so that little has to be compiled."""
    starts = [START, (1.3, 0.4)]
    arguments = [[ca.SX.sym(f"{s}{k}") for s in "ab"] for k in range(len(starts))]
    chosen = {op: starts.index(ELSEWHERE.get(op, START)) for op in SMOOTH}
    own = [of(op, *arguments[k]) for op, k in chosen.items()]
    states = [*chain(*arguments), *[ca.SX.sym(f"of_{op}") for op in SMOOTH]]
    system = ns.FilippovSystem(states, field=[1.0] * 4 + own)
    return system, [*chain(*starts), *[0.0] * len(SMOOTH)]


@pytest.mark.parametrize("lanes", [False, True])
def test_operations_of_states(lanes):
    system, start = moving()
    if lanes:
        found = ns.ensemble(system, np.tile(start, (70, 1)), T_END, tol=1e-12).x[[0, 69]]
    else:
        found = [ns.simulate(system, start, T_END, tol=1e-12).x[-1]]
    for row in found:
        values = dict(zip(SMOOTH, row[4:].tolist(), strict=True))
        assert values == pytest.approx({op: integral(op) for op in SMOOTH}, rel=1e-10)


@pytest.mark.parametrize("lanes", [False, True])
@pytest.mark.parametrize(
    "values", [(0.3, 0.4), (-0.6, 0.25), (1.0, 0.0), (-0.5, -0.5), (0.5, -3.0)]
)
def test_operations_of_parameters(lanes, values):
    """Those that have a finite value there."""
    given, known = dict(zip((p, q), values, strict=True)), {}
    for op in (*UNARY, *BINARY):
        value = float(ca.evalf(of(op, *map(ca.SX, values))))
        if np.isfinite(value):
            known[op] = float(mpmath.erfinv(values[0])) if op == "erfinv" else value
    states = [ca.SX.sym(f"of_{op}") for op in known]
    system = ns.FilippovSystem(states, field=[of(op, p, q) for op in known], parameters=[p, q])
    expected = np.array(list(known.values()))
    start, options = np.zeros(len(known)), {"parameters": given}
    if lanes:
        found = ns.ensemble(system, np.tile(start, (70, 1)), 1.0, **options).x[69]
    else:
        found = ns.simulate(system, start, 1.0, **options).x[-1]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("op", SMOOTH)
def test_operations_are_proven(op):
    pytest.importorskip("flint")
    system = ns.FilippovSystem([x, y, p], field=[1, 1, of(op, x, y)])
    proof = ns.certify_orbit(system, [*ELSEWHERE.get(op, START), 0], T_END)
    assert proof.proven
    (low, high), exact = proof.end["p"].ends, integral(op)
    assert low - 1e-15 <= exact <= high + 1e-15 and high - low < 1e-12


@pytest.mark.parametrize("op", NOT_SMOOTH)
def test_operations_that_are_not_smooth_are_refused_by_name(op):
    pytest.importorskip("flint")
    name = NOT_SMOOTH[op].split()[0]
    given = of(op, x - 0.25, y)
    for call in (
        lambda e: ns.FilippovSystem([x, y], field=[1, e]),
        lambda e: ns.FilippovSystem([x, y], surface=x, above=[1, e], below=[1, 1]),
        lambda e: ns.FilippovSystem([x, y], surface=x - e / 9, above=[1, 1], below=[1, 1]),
        lambda e: ns.FilippovSystem([x, y], field=[1, 1], stops=ns.Stop(ca.sin(x - e))),
    ):
        with pytest.raises(ns.NotSmoothError) as caught:
            call(given)
        assert name in str(caught.value)
    still = ns.FilippovSystem([x, y], field=[1, of(op, p, q) + 1], parameters={p: 0.3, q: 0.4})
    if op in PROVEN:
        assert ns.certify_orbit(still, [0, 0], 1).proven
        return
    with pytest.raises(ns.NotSmoothError, match=f"'{op}'"):
        ns.certify_orbit(still, [0, 0], 1)
