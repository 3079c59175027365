"""Unknowns that enter nonlinearly: folds of hidden laws, several roots in a layer, products of multipliers."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, t, lam = (ca.SX.sym(s) for s in ("x", "y", "z", "t", "lam"))
REACHED = ns.Status.REACHED_END


def test_a_slide_ends_where_its_two_solutions_merge():
    """(lam - 1/2)(lam + 1/5) = y has the roots 0.15 -+ sqrt(0.1225 + y); lam is what z' shows."""
    field = [(lam - 0.5) * (lam + 0.2) - y, -0.1, lam]
    system = ns.FilippovSystem([x, y, z], surface=x, multipliers=lam, field=field, hidden=True)
    times = 3.225 - np.array([0.3, 1e-2, 1e-4, 1e-6, 1e-9])
    run = ns.simulate(system, [0.0, 0.2, 0.0], 6.0, start_mode="s", tol=1e-12, t_eval=times)
    assert run.itinerary == "s +" and run.status is REACHED
    assert run.events[0].t == pytest.approx(3.225, abs=1e-13)
    assert run.events[0].x[1] == pytest.approx(-0.1225, abs=1e-14)
    root = lambda s: (0.1225 + 0.2 - 0.1 * s) ** 1.5 / 0.15
    exact = lambda s: 0.15 * s - root(0.0) + root(s)
    assert run.events[0].x[2] == pytest.approx(exact(3.225), abs=1e-12)
    np.testing.assert_allclose(run.sample_x[:, 2], exact(times), rtol=0, atol=1e-12)


def test_a_multiplier_jumps_from_a_fold_to_the_next_root():
    """8 lam^3 - 2 lam = y turns round at lam = -1/sqrt(12), where the third root is 2/sqrt(12)."""
    law = lambda a: 8 * a**3 - 2 * a
    system = ns.FilippovSystem(
        [x, y, z], surface=x, multipliers=lam, field=[y - law(lam), 1, lam], hidden=True
    )
    run = ns.simulate(system, [0.0, -5.0, 0.0], 10.0, tol=1e-12)
    assert run.status is REACHED and run.itinerary == "s"
    primitive = lambda a: 6 * a**4 - a**2  # of a dy = a (24 a^2 - 2) da
    ends = [float(np.roots([8, 0, -2, -v])[0].real) for v in (5.0,)]
    turn = 1 / np.sqrt(12)
    lower = primitive(-turn) - primitive(-ends[0])
    upper = primitive(ends[0]) - primitive(2 * turn)
    assert run.x[-1, 2] == pytest.approx(lower + upper, abs=1e-10)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_products_of_multipliers_are_solved_together(count):
    """Each surface slides with lam_i = a_i + lam_1 ... lam_n / 4, which one point of [-1, 1]^n solves."""
    a = np.array([0.3, -0.2, 0.4, 0.1])[:count]
    h = [ca.SX.sym(f"h{i}") for i in range(count)]
    w = [ca.SX.sym(f"w{i}") for i in range(count)]
    own = [ca.SX.sym(f"l{i}") for i in range(count)]
    product = own[0]
    for other in own[1:]:
        product = product * other
    rates = [float(v) - u + product / 4 for v, u in zip(a, own, strict=True)]
    system = ns.FilippovSystem([*h, *w], field=[*rates, *own], multipliers=own, surfaces=h)
    run = ns.simulate(system, [0.0] * (2 * count), 1.0, tol=1e-12)
    assert run.itinerary == "s" * count
    lam_ = run.x[-1, count:]
    np.testing.assert_allclose(lam_, a + np.prod(lam_) / 4, rtol=0, atol=1e-14)


@pytest.mark.parametrize("hump", [0.65, 1.5])
def test_blocks_with_static_friction_do_not_disturb_one_another(hump):
    """Two blocks on one belt, not coupled: the events of each are those of it alone."""
    a, b, q, p = (ca.SX.sym(s) for s in "abqp")
    law = lambda own: 0.4 * own * (1 + hump * (1 - own**2))
    one = ns.FilippovSystem(
        [x, y], field=[y, -x - law(a)], surface=y - 0.3, multipliers=a, hidden=True
    )
    two = ns.FilippovSystem(
        [x, y, q, p],
        field=[y, -x - law(a), p, -1.7 * q - law(b)],
        surfaces=[y - 0.3, p - 0.2],
        multipliers=[a, b],
        hidden=True,
    )
    alone = ns.simulate(one, [0.0, 0.3], 30.0, tol=1e-11)
    both = ns.simulate(two, [0.0, 0.3, 0.1, 0.2], 30.0, tol=1e-11)
    assert alone.status is REACHED and both.status is REACHED
    times = [e.t for e in both.events if e.mode_before[0] != e.mode_after[0]]
    expected = [e.t for e in alone.events if e.mode_before != e.mode_after]
    np.testing.assert_allclose(times, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(both.x[-1, :2], alone.x[-1], rtol=0, atol=1e-8)


def test_hidden_laws_of_two_surfaces_act_on_one_another():
    """a + a^3 and b + b^3 with an arm between: constants that fsolve would find too."""
    a, b, u, w = (ca.SX.sym(s) for s in "abuw")
    first, second = 0.3 - a - a**3 - 0.4 * b, 0.2 - b - b**3 + 0.5 * a
    system = ns.FilippovSystem(
        [x, y, u, w], field=[first, second, a, b], surfaces=[x, y], multipliers=[a, b], hidden=True
    )
    run = ns.simulate(system, [0.0, 0.0, 0.0, 0.0], 1.0, tol=1e-12)
    assert run.status is REACHED and run.itinerary == "ss"
    own = run.x[-1, 2:]
    rates = [0.3 - own[0] - own[0] ** 3 - 0.4 * own[1], 0.2 - own[1] - own[1] ** 3 + 0.5 * own[0]]
    np.testing.assert_allclose(rates, 0.0, atol=1e-14)
