"""A run that cannot go on ends with a status and says why."""

import casadi as ca
import pytest

import nonsmooth as ns

x, y, u, v, lam, kap, r = (ca.SX.sym(s) for s in ("x", "y", "u", "v", "lam", "kap", "r"))


def relays(field):
    """Relays at x = 0 and y = 0 with a field of their multipliers."""
    return ns.FilippovSystem([x, y], surfaces=[x, y], multipliers=[lam, kap], field=field)


def repelling(n):
    states, multipliers = ca.SX.sym("x", n), ca.SX.sym("l", n)
    surfaces = [states[i] for i in range(n)]
    return ns.FilippovSystem(states, surfaces=surfaces, multipliers=multipliers, field=multipliers)


# x' = 2 mu, y' = -2 lam turns round the corner; + a lam, a mu leads outward, so that no layer attracts.
SPIRAL = relays([0.2 * lam + 2 * kap, -2 * lam + 0.2 * kap])
ROOT = ns.FilippovSystem([x, y], surface=ca.sqrt(y) - 1, above=[1, -1], below=[1, -1])
POLE = ns.FilippovSystem([x, y], field=[1 / y, 0])
HOLE = ns.FilippovSystem([x, y], field=[-1, 0], resets=ns.Reset(x, map=[1 / y, y], name="hit"))
# With slip to the right the reaction pulls the tip into the ground: r (1 - 2) - 1 < 0 for every r.
PAINLEVE = ns.FilippovSystem(
    [x, y, u, v],
    field=[u, v, -0.2 * lam * r, r * (1 - 2 * lam) - 1],
    surface=u,
    multipliers=lam,
    impacts=ns.Impact(y, reaction=r, name="tip"),
)

ENDS = {
    "no root": (ROOT, [0.0, -1.0], "NOT_FINITE", "A switching function is not finite."),
    "a pole": (POLE, [1.0, 0.0], "NOT_FINITE", "The field of mode '' at (1, 0)."),
    "a hole": (HOLE, [1.0, 0.0], "NOT_FINITE", "The map of reset 'hit' at t = 1."),
    "a spiral": (
        SPIRAL,
        [0.0, 0.0],
        "INTERSECTION",
        "No mode leaves or slides stably along h0 and h1 = 0.",
    ),
    "five": (
        repelling(5),
        [0.0] * 5,
        "NON_UNIQUE",
        "the motion can continue in each of the modes '+++++', '++++-'",
    ),
    "seven": (repelling(7), [0.0] * 7, "NON_UNIQUE", "in each of the modes '+++++++', '++++++-'"),
    "Painleve": (
        PAINLEVE,
        [0.0, 0.0, 1.0, 0.0],
        "INCONSISTENT",
        "At 'tip' neither the closed contact nor an open one holds.",
    ),
}


@pytest.mark.parametrize("name", ENDS)
def test_what_cannot_go_on_says_why(name):
    system, start, status, message = ENDS[name]
    run = ns.simulate(system, start, 3.0)
    assert (run.status.name, message in run.message) == (status, True), run.message


def test_a_start_mode_with_two_sliding_solutions_is_not_unique():
    """lam mu = 1/4 and lam = mu along the corner: both 1/2 or both -1/2."""
    system = relays([lam * kap - 0.25, lam - kap])
    run = ns.simulate(system, [0.0, 0.0], 1.0, start_mode="ss")
    assert run.status is ns.Status.NON_UNIQUE
    assert "start_mode 'ss' has 2 sliding solutions here." in run.message
    assert ns.flow.follow(system, [0.0, 0.0], 1.0, mode="ss").status is ns.Status.NON_UNIQUE
