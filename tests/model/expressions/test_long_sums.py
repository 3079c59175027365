"""Long sums are read as one: runs and printed series are those of their operations, bit by bit."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.model import coupled_of
from nonsmooth.model.expressions import long_sums
from nonsmooth.model.printing.instructions import instructions_of
from nonsmooth.model.printing.jets import Expansion
from nonsmooth.model.printing.terms import Graph

N = 20
X, L, P, T = (ca.SX.sym(name, size) for name, size in (("x", N), ("l", 1), ("p", 1), ("t", 1)))
GENERATOR = np.random.default_rng(0)
WEIGHTS = GENERATOR.normal(size=(N, N)) * 1.5 / np.sqrt(N)
W, TANH = ca.DM(WEIGHTS), ca.tanh(X)


def loops(sign):
    """Sums of a loop, each from another term on, with some terms subtracted and one alone."""
    rows = []
    for i, row in enumerate(WEIGHTS):
        total = -X[i]
        for j, w in enumerate(row):
            total = (
                total + ((-sign) ** i if j == 15 else w) * TANH[j] if j % 3 else total - w * TANH[j]
            )
        rows.append(total)
    return ca.vertcat(*rows)


#: Fields, and how many long sums they have.
FIELDS = {
    "network": (-X + W @ TANH, N),
    "twice": (-X + 2 * W @ ca.sin(X), N),
    "less": (-X - W @ TANH, N),
    "alone": (W @ TANH, N),
    "product": (-X + X * (W @ ca.tanh(2 * X + 0.1)), N),
    "gain": (-X + P * (W @ TANH), N),
    "forced": (-X + W @ ca.tanh(X + ca.cos(T)), N),
    "in two fields": (-X + (1 + L) / 2 * (W @ TANH) + (1 - L) / 2 * (W.T @ ca.cos(X)), 2 * N),
    "once more": (-X + W @ TANH + 0.1 * ca.cos(W @ TANH), N),
    "loop": (loops(1.0), N),
    "loop of differences": (loops(-1.0), N),
    "two layers": (-X + W @ ca.tanh(W.T @ TANH), 0),
    "alike": (-X + 0.1 * ca.DM.ones(N, N) @ TANH, 1),
    "in part": (-X + ca.DM(np.where(np.arange(N) < 3, 0.1, WEIGHTS)) @ TANH, 0),
    "of logarithms": (-X + W @ ca.tanh(ca.log(4 + X)), 0),
    "of states": (-X + 0.3 * W @ X, 0),
    "of multipliers": (-X + W @ ca.tanh(X + 0.1 * L * X[0]), N),
}


def system_of(field, hidden=False):
    push = ca.DM.zeros(N)
    push[0] = 1
    return ns.FilippovSystem(
        X,
        field=field - L * push,
        surface=X[0] - 0.1,
        multipliers=L,
        parameters={P: 0.7},
        time=T,
        hidden=hidden,
    )


def both(field, hidden, work, monkeypatch):
    """What is done with a system whose long sums are read as one, and whose are not."""
    found = []
    for least in (0, 10**9):
        monkeypatch.setattr(long_sums, "_OPERATIONS", least)
        found.append(work(system_of(field, hidden)))
    return found


@pytest.mark.parametrize("name", FIELDS)
def test_runs_have_the_same_bits(name, monkeypatch):
    (field, count), start = FIELDS[name], np.random.default_rng(1).normal(size=N)

    def run(system):
        sums = coupled_of(system).sums
        found = ns.simulate(system, start, 1.5, tol=1e-9)
        return 0 if sums is None else len(sums.factors), found

    hidden = name == "of multipliers"
    (found, short), (none, plain) = both(field, hidden, run, monkeypatch)
    assert (found, none) == (count, 0)
    assert short.itinerary == plain.itinerary
    assert short.x.tobytes() == plain.x.tobytes()
    assert short.t.tobytes() == plain.t.tobytes()


@pytest.mark.parametrize("name", ["network", "gain", "loop of differences"])
def test_printed_series_are_the_same(name, monkeypatch):
    def coefficients(system):
        coupled, graph = coupled_of(system), Graph()
        rules, rows = instructions_of(coupled).series.printed
        series, found = Expansion(rules, rows, [graph.constant(0.7)], graph), []
        moving = np.linspace(-0.8, 0.9, coupled.moving.numel())
        for k in range(4):
            own = series.advance(k, [graph.number(float(v) / (k + 1)) for v in moving])
            found.append([0.0 if e is None else e.value for row in own for e in row])
        return np.array(found, float)

    short, plain = both(FIELDS[name][0], False, coefficients, monkeypatch)
    np.testing.assert_allclose(short, plain, rtol=1e-12, atol=1e-13)
    assert abs(plain[3]).max() > 1e-3
