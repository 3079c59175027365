"""Complementarity conditions: diodes, projections and sweeping sets against closed forms and exact modes."""

import pickle

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nonsmooth as ns

from ..independent.circuits import Circuit, driven
from ..independent.networks import network

REACHED = ns.Status.REACHED_END


def circuit(a, b, c, d):
    """The system of linear complementarity with these matrices."""
    x, nu = ca.SX.sym("x", len(a)), ca.SX.sym("nu", len(c))
    y = ca.SX(ca.DM(c)) @ x + ca.SX(ca.DM(d)) @ nu
    conditions = [ns.Complementarity(y[i], multiplier=nu[i], name=f"d{i}") for i in range(len(c))]
    field = ca.SX(ca.DM(a)) @ x + ca.SX(ca.DM(b)) @ nu
    return ns.FilippovSystem(ca.vertsplit(x), field=ca.vertsplit(field), complementarity=conditions)


SOURCE = [[0.0], [0.0]]
BRIDGE = (
    [[0, -1], [1, 0]],
    [[0, 0, -1, 1], [0, 0, 0, 0]],
    [[0, 0], [0, 0], [-1, 0], [1, 0]],
    [[0.5, 0.5, -1, 0], [0.5, 0.5, 0, -1], [1, 0, 0, 0], [0, 1, 0, 0]],
)
LOAD, PAIR = driven([[-0.1]], [0]), [[1, 1], [0, 0], [0, 0]]
ONE, SIDE_BY_SIDE = (LOAD, [[1], *SOURCE], [[1, -1, 0]]), (LOAD, PAIR, [[1, -1, 0]] * 2)
DOUBLER = (
    driven([[0, 0], [0, -0.02]], [0, 0]),
    [[-1, 1], [0, 1], [0, 0], [0, 0]],
    [[-1, 0, 1, 0], [1, 1, -1, 0]],
)
#: Matrices, voltages and currents at the start with a driving sine, and the degree of the conditions.
CIRCUITS = {
    "four diodes on a resonator": (BRIDGE, [1.0, 0.0], 0),
    "four diodes from a voltage of zero": (BRIDGE, [0.0, 1.0], 0),
    "peak rectifier": ((*ONE, [[0]]), [0, 0, 1], 1),
    "peak rectifier with a resistance": ((*ONE, [[0.1]]), [0, 0, 1], 0),
    "two diodes side by side": ((*SIDE_BY_SIDE, 0.1 * np.ones((2, 2))), [0, 0, 1], 0),
    "two ideal diodes side by side": ((*SIDE_BY_SIDE, np.zeros((2, 2))), [0, 0, 1], 1),
    "full wave with a filter": (
        (LOAD, PAIR, [[1, -1, 0], [1, 1, 0]], np.zeros((2, 2))),
        [0, 0, 1],
        1,
    ),
    "voltage doubler": ((*DOUBLER, np.zeros((2, 2))), [0, 0, 0, 1], 1),
    "voltage doubler with resistances": ((*DOUBLER, 0.05 * np.eye(2)), [0, 0, 0, 1], 0),
    "coil behind a diode": (
        (driven([[-1]], [1]), [[1], *SOURCE], [[1, 0, 0]], [[0]]),
        [0, 0, 1],
        1,
    ),
}


@pytest.mark.parametrize("name", CIRCUITS)
def test_a_circuit_is_that_of_its_exact_modes(name):
    matrices, start, degree = CIRCUITS[name]
    system = circuit(*matrices)
    assert len(system.algebraic) == (0 if degree else len(system.complementarity))
    run = ns.simulate(system, start, t_end=14.0, tol=1e-10)
    assert run.status is REACHED, run.message
    assert len(run.events) > 4
    assert abs(run.x[-1] - Circuit(*matrices).run(start, 14.0)).max() < 1e-9


def random_circuit(seed):
    """Passive parts drawn at random: conditions of degree 1 or 0, the latter with gyrators, and of both degrees."""
    rng = np.random.default_rng(seed)
    n, m, kind = *rng.integers(2, 5, 2), seed % 4
    m = min(m, n)
    a = driven(rng.normal(size=(n, n)) - np.eye(n), 2 * rng.normal(size=n), rng.uniform(0.5, 3))
    c = rng.normal(size=(m, n))
    b = np.vstack([rng.uniform(0.3, 3, (n, 1)) * c.T, np.zeros((2, m))])
    c = np.hstack([c, rng.normal(size=(m, 2))])
    k, d = (0, m, m, m // 2)[kind], np.zeros((m, m))
    q, turn = rng.normal(size=(2, k, k))
    d[:k, :k] = 0.3 * q @ q.T + 0.1 * np.eye(k) + (turn - turn.T) * (kind == 2)
    return (a, b, c, d), np.array([*rng.normal(size=n), 0, 1])


def proportional_circuit(seed):
    """Diodes side by side whose currents and voltages count in different units: one number of rank 1."""
    (a, b, c, _), start = random_circuit(4 * seed)
    q = abs(np.random.default_rng(seed).normal(size=4)) + 0.02
    return (a, np.outer(b[:, 0], q), np.outer(q, c[0]), np.outer(q, q) / 2), start


@pytest.mark.parametrize("draw", [random_circuit, proportional_circuit])
@pytest.mark.parametrize("seed", range(8))
def test_random_circuits_are_those_of_their_exact_modes(draw, seed):
    matrices, start = draw(seed)
    run = ns.simulate(circuit(*matrices), start, t_end=5.0, tol=1e-10)
    assert run.status is REACHED, run.message
    first = run.events[0]
    exact = Circuit(*matrices).run(first.x_after if first.kind == "jump" else start, 5.0, 200)
    assert abs(run.x[-1] - exact).max() < 1e-8 * (1 + abs(exact).max())


def test_a_jump_from_outside_an_ellipse_is_to_its_nearest_point():
    """The direction of the multiplier is that of the normal where the jump ends."""
    x, y, lam = (ca.SX.sym(name) for name in ("x", "y", "lam"))
    inside = (1 - x**2 / 4 - y**2) / 2
    system = ns.FilippovSystem(
        [x, y],
        field=[-lam * x / 4, -lam * y],
        complementarity=ns.Complementarity(inside, multiplier=lam),
    )
    found = ns.simulate(system, [5.0, 4.0], t_end=0.1).events[0].x_after
    normal = np.array([found[0] / 4, found[1]])
    away = np.array([5.0, 4.0]) - found
    assert abs(found[0] ** 2 / 4 + found[1] ** 2 - 1) < 1e-13
    assert abs(normal[0] * away[1] - normal[1] * away[0]) < 1e-12
    assert normal @ away > 0


def test_a_system_says_what_it_has():
    i, u, t = (ca.SX.sym(name) for name in "iut")
    diode = ns.Complementarity(i, multiplier=u, name="diode")
    system = ns.FilippovSystem([i], field=[ca.sin(t) - i + u], complementarity=diode, time=t)
    assert repr(system) == "FilippovSystem(1 state: i; time t; complementarity 'diode')"
    assert (system.complementarity, system.modes) == (("diode",), ("o", "c"))
    again = pickle.loads(pickle.dumps(system))
    assert again == system
    assert again.complementarity == ("diode",)
    assert "diode" in system._repr_html_()
    assert system.field("o")[0].__str__() == str(ca.sin(t) - i)
    with pytest.raises(ns.DefinitionError, match="one per complementarity condition"):
        system.parse_letters("+")


def test_start_modes_and_sections():
    i, u, t = (ca.SX.sym(name) for name in "iut")
    diode = ns.Complementarity(i, multiplier=u, name="diode")
    system = ns.FilippovSystem([i], field=[ca.sin(t) - i + u], complementarity=diode, time=t)
    options = {"t_end": 20.0, "t_start": 4.5}
    assert ns.simulate(system, [0.0], start_mode="c", **options).itinerary == "c o c o c o"
    assert ns.simulate(system, [0.0], start_mode="o", **options).status is ns.Status.NON_UNIQUE
    closing = ns.simulate(system, [0.0], t_end=20.0, at=ns.Section("diode", direction=-1))
    opening = ns.simulate(system, [0.0], t_end=20.0, at=ns.Section("diode", direction=1))
    assert opening.sample_t == pytest.approx([2 * np.pi, 4 * np.pi, 6 * np.pi])
    assert closing.sample_t == pytest.approx([3.94073313, 10.2239184, 16.5071037])


def test_files_and_ensembles(tmp_path):
    matrices, start, _ = CIRCUITS["full wave with a filter"]
    system = circuit(*matrices)
    run = ns.simulate(system, start, t_end=10.0)
    run.save(tmp_path / "run.npz")
    loaded = ns.load(tmp_path / "run.npz")
    assert loaded.system == system
    assert loaded.events == run.events
    voltages = [0.0, 0.5, -0.5, 2.0]
    many = ns.ensemble(system, [[v, 0.0, 1.0] for v in voltages], t_end=10.0)
    for k, v in enumerate(voltages):
        alone = ns.simulate(system, [v, 0.0, 1.0], t_end=10.0)
        assert (many.x[k] == alone.x[-1]).all()
        assert many.itinerary[k] == alone.itinerary
    assert many.events["jump"].tolist() == [0, 0, 1, 0]


def test_a_buck_converter_with_a_clock_and_a_switch_that_is_a_state():
    """Linear between ticks, ends of the switch and zeros of the current, each found by an integrator of its own."""
    i, v, u, s = (ca.SX.sym(name) for name in "ivus")
    clock = ns.Clock(0.2, map={s: 1.0}, name="tick")
    system = ns.FilippovSystem(
        [i, v],
        field=[10 * (s - v + u), i - v / 5],
        complementarity=ns.Complementarity(i, multiplier=u, name="diode"),
        discrete={s: (0, 1)},
        clocks=clock,
        resets=ns.Reset(clock.phase - 0.08, {s: 0}, 1, name="off"),
    )
    run = ns.simulate(system, [0.0, 0.5, 0.0, 1.0], t_end=2.0, tol=1e-10)
    assert run.status is REACHED, run.message
    x = np.array([0.0, 0.5])
    for _ in range(10):
        for on, left in ((1, 0.08), (0, 0.12)):
            while left > 1e-14:
                x, passed = conducted(x, on, left) if x[0] > 0 or on > x[1] else blocked(x, left)
                left -= passed
    assert abs(run.x[-1, :2] - x).max() < 1e-9
    assert {event.name for event in run.events} > {"tick", "off", "diode"}


def conducted(x, on, left):
    ends = lambda t, y: y[0] if t > 1e-12 else 1.0
    ends.terminal, ends.direction = True, -1
    field = lambda t, y: [10 * (on - y[1]), y[0] - y[1] / 5]
    found = solve_ivp(field, (0, left), x, method="DOP853", rtol=1e-11, atol=1e-13, events=ends)
    return np.array(
        [max(found.y[0, -1], 0.0) if found.status == 0 else 0.0, found.y[1, -1]]
    ), found.t[-1]


def blocked(x, left):
    return np.array([0.0, x[1] * np.exp(-left / 5)]), left


@pytest.mark.parametrize("resistance", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_a_small_resistance_is_close_to_none(resistance):
    v, i, t = (ca.SX.sym(name) for name in "vit")
    ends = []
    for r in (0, resistance):
        diode = ns.Complementarity(v + r * i - ca.sin(t), multiplier=i)
        system = ns.FilippovSystem([v], field=[i - v / 10], complementarity=diode, time=t)
        run = ns.simulate(system, [0.0], t_end=8.0, tol=1e-10)
        assert run.status is REACHED, run.message
        ends.append(run.x[-1, 0])
    assert abs(ends[1] - ends[0]) < resistance**2 + 1e-11  # the end of conduction is a maximum of v


def test_the_node_between_two_diodes_in_series_floats_while_both_block():
    """One carries its current, the other its voltage; blocking, any part of the voltage may be at either."""
    v, i, u, t = (ca.SX.sym(name) for name in "viut")
    one = ns.Complementarity(v - ca.sin(t) - u + 0.1 * i, multiplier=i, name="one")
    two = ns.Complementarity(i, multiplier=u, name="two")
    alone = ns.Complementarity(v - ca.sin(t) + 0.1 * i, multiplier=i)
    ends = []
    for conditions in ([one, two], alone):
        system = ns.FilippovSystem([v], field=[i - v / 10], complementarity=conditions, time=t)
        run = ns.simulate(system, [0.3], t_end=10.0, tol=1e-10)
        assert run.status is REACHED, run.message
        assert len(run.events) == 5
        ends.append(run.x[-1])
    assert abs(ends[0] - ends[1]).max() < 1e-12


def test_capacities_joined_by_a_bridge():
    """Four diodes with currents and voltages mixed join a resonator and a capacity, as two pairs of joined diodes do."""
    a = [[0, -1, 0], [1, 0, 0], [0, 0, -0.2]]
    b, c = [[0, 0, -1, 1], [0] * 4, [1, 0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 1], [1, 0, 0]]
    four = circuit(a, b, c, [[0, -1, 0, 0], [1, 0, 1, -1], [0, -1, 0, 0], [0, 1, 0, 0]])
    pairs = circuit(a, [[-1, 1], [0, 0], [1, 1]], [[-1, 0, 1], [1, 0, 1]], np.zeros((2, 2)))
    runs = [ns.simulate(s, [1.0, 0.0, 2.0], t_end=20.0, tol=1e-10) for s in (four, pairs)]
    assert [run.status for run in runs] == [REACHED, REACHED]
    assert abs(runs[0](np.linspace(0, 20, 60)) - runs[1](np.linspace(0, 20, 60))).max() < 1e-9
    start, by = np.array([1.0, 0.2, 1.4]), 1e-5
    end = lambda x: ns.simulate(four, x, t_end=3.0, tol=1e-11).x[-1]
    differences = [(end(start + by * e) - end(start - by * e)) / (2 * by) for e in np.eye(3)]
    found = ns.sensitivity(ns.simulate(four, start, t_end=3.0, tol=1e-11))
    assert abs(found.dx_dx0 - np.transpose(differences)).max() < 1e-7
    charged = ns.simulate(four, [1.0, 0.0, 0.5], t_end=1.0)
    assert charged.events[0].kind == "jump"
    assert charged.events[0].x_after == pytest.approx([0.75, 0.0, 0.75])


def is_that_of_its_network(seed, diodes=None):
    """Whether a random network runs as its exact modes do; None where these end, as a current that is forced through
    a diode does."""
    matrices, start = network(seed, diodes)
    run = ns.simulate(circuit(*matrices), start, t_end=5.0, tol=1e-9)
    first = run.events[0]
    exact = Circuit(*matrices).run(first.x_after if first.kind == "jump" else start, 5.0, 200)
    if exact is None:
        return None
    assert run.status is REACHED, run.message
    return abs(run.x[-1] - exact).max() < 1e-6 * (1 + abs(exact).max())


@pytest.mark.parametrize("seed", [4, 7, 23, 24, 46, 53, 68, 190, 369, 378])
def test_networks_whose_diodes_join_capacities(seed):
    assert is_that_of_its_network(seed)


@pytest.mark.parametrize("seed", [16, 28, 31, 35, 40])
def test_networks_with_a_small_resistance_in_each_port_are_close_to_ideal(seed):
    (*rates, d), start = network(seed)
    ideal, real = (
        ns.simulate(circuit(*rates, d + r * np.eye(len(d))), start, t_end=5.0, tol=1e-9)
        for r in (0, 1e-6)
    )
    assert real.status is REACHED, real.message
    assert abs(real.x[-1] - ideal.x[-1]).max() < 1e-4


@pytest.mark.slow
def test_random_networks_of_diodes():
    found = [is_that_of_its_network(seed) for seed in range(120)]
    assert found.count(True) > 100
    assert not found.count(False)
    assert [is_that_of_its_network(seed, 9) for seed in (1, 2, 5)] == [True] * 3


def test_conditions_beside_contacts_friction_and_constraints():
    """Parts that do not act on one another are what each is alone."""
    x, y, i, u, v, lam, t = (ca.SX.sym(name) for name in ("x", "y", "i", "u", "v", "lam", "t"))
    diode = ns.Complementarity(i, multiplier=u, name="diode")
    coil = ns.FilippovSystem([i], field=[ca.sin(t) - i + u], complementarity=diode, time=t)
    body = ns.FilippovSystem(
        [x, y, v],
        field=[y, -9.81, ca.sin(2 * t) - 0.6 * lam],
        surfaces=[v],
        multipliers=[lam],
        impacts=ns.Impact(x, 0.5, name="floor"),
        time=t,
    )
    both = ns.FilippovSystem(
        [x, y, v, i],
        field=[y, -9.81, ca.sin(2 * t) - 0.6 * lam, ca.sin(t) - i + u],
        surfaces=[v],
        multipliers=[lam],
        impacts=ns.Impact(x, 0.5, name="floor"),
        complementarity=diode,
        time=t,
    )
    run = ns.simulate(both, [1.0, 0.0, 0.5, 0.3], t_end=8.0)
    assert run.status is REACHED, run.message
    assert abs(run.x[-1, :3] - ns.simulate(body, [1.0, 0.0, 0.5], t_end=8.0).x[-1]).max() < 1e-8
    assert abs(run.x[-1, 3:] - ns.simulate(coil, [0.3], t_end=8.0).x[-1]).max() < 1e-8
    assert {len(mode) for mode in run.itinerary.split()} == {3}
    assert {mode[1] for mode in run.itinerary.split()} == {"o", "c"}


REFUSED = {
    "second derivative": (["v", "-x + lam"], "x", "Impact"),
    "nowhere": (["v", "-x"], "x", "not in the field"),
    "never": (["v + lam", "-x"], "v**2*0 + 1", "never changes"),
    "multiple zero": (["v + lam", "-x"], "x**3", "3 times"),
    "bent": (["v + lam", "-x"], "x + lam**2", "not linear"),
    "product": (["v + lam*v + lam**2", "-x"], "x", "linear in all multipliers"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_complementarity_is_refused_by_name(name):
    field, y, match = REFUSED[name]
    x, v, lam = (ca.SX.sym(s) for s in ("x", "v", "lam"))
    known = {"x": x, "v": v, "lam": lam}
    with pytest.raises(ns.DefinitionError, match=match):
        ns.FilippovSystem(
            [x, v],
            field=[eval(f, {}, known) for f in field],
            complementarity=ns.Complementarity(eval(y, {}, known), multiplier=lam),
        )


def test_an_impact_that_is_a_diode_names_complementarity():
    i = ca.SX.sym("i")
    with pytest.raises(ns.DefinitionError, match="Complementarity"):
        ns.FilippovSystem([i], field=[1 - i], impacts=ns.Impact(i))


def test_functions_for_surfaces_refuse_it():
    matrices, start, _ = CIRCUITS["peak rectifier"]
    with pytest.raises(ns.DefinitionError, match="complementarity conditions"):
        ns.manifold(circuit(*matrices), start)
