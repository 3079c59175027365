"""Conditions, contacts and joints at a point: the same answers as in coordinates, by limits and by runs."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nonsmooth as ns
from tests.drawing import at_most

x, y, z, u, v, w, r, lam, mu, own, t = (
    ca.SX.sym(s) for s in ("x", "y", "z", "u", "v", "w", "r", "lam", "mu", "own", "t")
)
SEEDS = st.integers(0, 10**6)


def _diode(field, function=x, states=(x, y), **more):
    condition = ns.Complementarity(function, multiplier=u, name="diode")
    return ns.FilippovSystem(states, field=field, complementarity=condition, **more)


COIL = _diode([u - y - x, x - y + 1])


@pytest.mark.parametrize(
    ("point", "kind", "label", "letter"),
    [
        ([0, 1], "pseudo-equilibrium", "stable pseudo-node", "c"),
        ([0, -1], "leaving", "leaving", "o"),
        ([0, 0.5], "closed", "closed", "c"),
        ([0, 0], "fold", "invisible", "c"),
    ],
)
def test_the_boundary_of_a_condition_of_degree_one(point, kind, label, letter):
    found = ns.classify(COIL, point)
    assert (found.kind, found.label) == (kind, label)
    assert ns.simulate(COIL, point, 0.1).itinerary == letter
    assert COIL.switching(0).kind == "generic"
    if letter == "c":
        assert found.evidence["multiplier"] == point[1]
        np.testing.assert_allclose(ns.sliding_field(COIL, point), [0, 1 - point[1]], atol=1e-15)


def test_points_where_no_condition_changes():
    with pytest.raises(ns.PointError, match="inside the mode 'o'"):
        ns.region(COIL, [0.3, 0.2])
    with pytest.raises(ns.PointError, match="below zero"):
        ns.classify(COIL, [-0.1, 0.0])
    with pytest.raises(ns.PointError, match="no field below"):
        ns.local.alpha(COIL, [0.0, 0.5])
    at = ns.find_equilibrium(COIL, [0.1, 0.8], mode="c")
    assert ns.classify(COIL, at.point).label == "stable pseudo-node"


@pytest.mark.slow
@at_most(6)
@given(SEEDS)
def test_a_condition_of_degree_one_is_the_limit_of_a_strong_field_below(seed):
    """With a large push the surface has the same folds, boundary equilibria and eigenvalues along it."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-1, 1, (2, 2)), rng.uniform(-1, 1, 2)
    push, strong = np.array([1.0, rng.uniform(-1, 1)]), 1e3
    free = [a[i, 0] * x + a[i, 1] * y + mu * b[i] for i in (0, 1)]
    diode = _diode([f + u * p for f, p in zip(free, push, strict=True)], parameters={mu: 0.0})
    below = [f + strong * p for f, p in zip(free, push, strict=True)]
    limit = ns.FilippovSystem([x, y], surface=x, above=free, below=below, parameters={mu: 0.0})
    one, other = (ns.classify(s, [0, 0]) for s in (diode, limit))
    assert (one.kind, one.label) == (other.kind, other.label)
    given = {"mu": 0.5}
    for at in rng.uniform(-2, 2, 6):
        one, other = (ns.classify(s, [0, at], parameters=given) for s in (diode, limit))
        words = {"attracting sliding": "closed", "crossing up": "leaving"}
        assert one.label == words[other.label]
    fold = ns.find_fold(diode, [0.0, 0.1], mode="o", parameters=given)
    same = ns.find_fold(limit, [0.0, 0.1], parameters=given)
    np.testing.assert_allclose(fold.point, same.point, atol=1e-9)
    assert fold.kind == same.kind
    assert ns.classify(diode, fold.point, parameters=given).label == fold.kind


def test_a_condition_of_degree_zero_is_a_continuous_surface():
    """A diode with a resistor: i >= 0 of both currents, or the conductance jumps."""
    ideal = _diode([u - y - x, x - y], function=x + u)
    kinked = ns.FilippovSystem([x, y], surface=x, above=[-y - x, x - y], below=[-y - 2 * x, x - y])
    assert ideal.switching(0) == kinked.switching(0)
    for point in ([0.0, 1.0], [0.0, -0.3], [0.0, 0.0]):
        one, other = (ns.classify(s, point) for s in (ideal, kinked))
        assert (one.kind, one.label) == (other.kind, other.label)
    found = ns.local.boundary_equilibrium(ideal, [0.0, 0.0])
    assert found.switching == "continuous" and found.numbers["det A2"] == pytest.approx(3.0)
    assert _diode([u * y - x, x - y], function=x**2 + x + 2 * u).switching(0).order == 1
    with pytest.raises(ns.DefinitionError, match="continuous of order 1"):
        ns.find_fold(ideal, [0.0, 0.1], mode="o")


def test_conditions_that_share_their_multipliers_are_continuous_in_every_mode():
    a, b = (
        ns.Complementarity(e, multiplier=m, name=str(m))
        for e, m in ((x + u + w / 3, u), (y + w + u / 3, w))
    )
    system = ns.FilippovSystem([x, y], field=[u - y, w - y + u], complementarity=[a, b])
    for mode in ("oo", "oc", "co", "cc", None):
        assert [system.switching(i, mode=mode).name for i in (0, 1)] == [
            "continuous of order 1"
        ] * 2
    assert ns.classify(system, [0.0, 2.0]).kind == "crossing"
    assert (
        ns.classify(system, [-1 / 3, -1.0]).kind == "crossing"
    )  # x = y/3: u opens while w is closed
    with pytest.raises(ns.PointError, match="inside a mode"):
        ns.classify(system, [-1.0, -1.0])


# contacts ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("point", "push", "kind", "label"),
    [
        ([0, 1], -1.0, "leaving", "leaving"),
        ([0, -1], -1.0, "impact", "impact"),
        ([0, 0], -1.0, "pseudo-equilibrium", "stable pseudo-node"),
        ([0, 0], 1.0, "leaving", "leaving"),
    ],
)
def test_a_contact(point, push, kind, label):
    ball = ns.FilippovSystem([y, v], field=[v, push], impacts=ns.Impact(y, 0.5))
    found = ns.classify(ball, point)
    assert (found.kind, found.label) == (kind, label)


def test_a_block_that_slides_on_a_contact_is_one_on_a_floor():
    """Friction is bounded by the reaction: folds where the force is at the bound."""
    slip = ns.FilippovSystem(
        [x, y, v, w],
        field=[v, w, mu - x - 0.5 * r * lam, r - 1],
        surfaces=[v],
        multipliers=[lam],
        impacts=ns.Impact(y, 0.0, reaction=r),
        parameters={mu: 0.0},
    )
    floor = ns.FilippovSystem(
        [x, v], surface=v, above=[v, mu - x - 0.5], below=[v, mu - x + 0.5], parameters={mu: 0.0}
    )
    for at in (-0.7, -0.5, 0.0, 0.3, 0.5, 0.8):
        one = ns.classify(slip, [at, 0, 0, 0], parameters={"mu": 0.1})
        other = ns.classify(floor, [at, 0], parameters={"mu": 0.1})
        assert (one.kind, one.label, one.side) == (other.kind, other.label, other.side)
        assert one.point.tolist() == [at, 0, 0, 0]
    assert ns.region(slip, [0.9, 0, 0, 0]) is ns.region(floor, [0.9, 0])
    free = ns.classify(slip, [0.2, 1.0, 0.0, 0.0])  # in the air there is no friction
    assert free.kind in ("touch", "degenerate", "crossing", "fold-fold")


def test_an_equilibrium_that_a_contact_meets():
    """A mass on a spring whose rest is at a height mu above the floor, and on a spring that pushes away."""
    for stiffness, unfolding in ((1.0, "persistence"), (-1.0, "nonsmooth fold")):
        mass = ns.FilippovSystem(
            [y, v],
            field=[v, -stiffness * (y - mu) - v / 5],
            impacts=ns.Impact(y, 0.3),
            parameters={mu: 0.0},
        )
        found = ns.classify(mass, [0.0, 0.0])
        assert (found.kind, found.label) == ("boundary equilibrium", unfolding)
        rests = [ns.classify(mass, [0, 0], parameters={"mu": m}).kind for m in (-0.1, 0.1)]
        closed = "pseudo-equilibrium"
        assert rests == ([closed, "leaving"] if stiffness > 0 else ["leaving", closed])


# joints --------------------------------------------------------------------------------------------


def _pendulums(force, surface):
    """A pendulum by joints and by its angle, with a torque +-force(angle, rate) on two sides of a surface."""
    angle, rate = ca.SX.sym("angle"), ca.SX.sym("rate")
    rod = ns.Constraint(x**2 + y**2 - 1, reaction=r, name="rod")
    turn, speed = ca.atan2(x, -y), x * w - y * v
    torque = lam * force(turn, speed)
    joint = ns.FilippovSystem(
        [x, y, v, w],
        field=[v, w, r * x - torque * y, r * y - 1 + torque * x],
        surfaces=[surface(turn, speed)],
        multipliers=[lam],
        constraints=rod,
    )
    plain = ns.FilippovSystem(
        [angle, rate],
        field=[rate, -ca.sin(angle) + lam * force(angle, rate)],
        surfaces=[surface(angle, rate)],
        multipliers=[lam],
    )
    return joint, plain


def _lifted(angle, rate):
    s, c = np.sin(angle), np.cos(angle)
    return [s, -c, rate * c, rate * s]


@at_most(4)
@given(SEEDS)
def test_a_pendulum_by_joints_is_that_by_its_angle(seed):
    rng = np.random.default_rng(seed)
    a, b, c, level = *rng.uniform(0.1, 0.6, 3), rng.uniform(-0.5, 0.5)
    sign = rng.choice([-1, 1])
    joint, plain = _pendulums(
        lambda q, s: sign * (a + b * ca.cos(q)), lambda q, s: s + c * ca.sin(q) - level
    )
    points = rng.uniform(-1.2, 1.2, 4)
    folds = []
    for side in "+-":
        try:
            folds.append(ns.find_fold(plain, [0.1, 0.1], side=side).point)
        except ns.ConvergenceError:
            continue
    for angle, rate in [*folds, *[(p, level - c * np.sin(p)) for p in points]]:
        one, other = ns.classify(joint, _lifted(angle, rate)), ns.classify(plain, [angle, rate])
        assert (one.kind, one.label, one.side) == (other.kind, other.label, other.side)
        for key in ("L1", "L2", "L11", "L22", "alpha"):
            assert one.evidence.get(key, 0) == pytest.approx(other.evidence.get(key, 0), abs=1e-12)
        if one.kind == "sliding":
            speed = ns.sliding_field(plain, [angle, rate])
            turned = ns.sliding_field(joint, _lifted(angle, rate))
            np.testing.assert_allclose(turned[:2], _lifted(angle, rate)[2:], atol=1e-12)
            tangent = np.array([np.cos(angle), np.sin(angle)])
            assert turned[2:] @ tangent == pytest.approx(speed[1], abs=1e-12)


def test_equilibria_folds_and_rest_of_a_pendulum_with_joints():
    joint, plain = _pendulums(lambda q, s: -0.3 - 0.2 * q, lambda q, s: s - 0.1 * ca.sin(q))
    for side in "+-":
        mode = f"{side}s"
        one = ns.find_equilibrium(joint, _lifted(0.3, 0.05), mode=mode)
        other = ns.find_equilibrium(plain, [0.3, 0.05], side=side)
        np.testing.assert_allclose(one.point, _lifted(*other.point), atol=1e-11)
        np.testing.assert_allclose(one.eigenvalues, other.eigenvalues, atol=1e-11)
        fold = ns.find_fold(joint, _lifted(0.3, 0.05), side=side, mode="ss")
        same = ns.find_fold(plain, [0.3, 0.05], side=side)
        assert fold.kind == same.kind and "ss" in joint.modes
        np.testing.assert_allclose(fold.point, _lifted(*same.point), atol=1e-9)
    one = ns.find_pseudo_equilibrium(joint, _lifted(0.1, 0.01), mode="ss")
    other = ns.find_pseudo_equilibrium(plain, [0.1, 0.01])
    assert (one.kind, one.status) == (other.kind, other.status)
    np.testing.assert_allclose(one.eigenvalues, other.eigenvalues, atol=1e-11)
    assert ns.classify(joint, one.point).label == one.kind


@pytest.mark.slow
@at_most(4)
@given(SEEDS)
def test_second_derivatives_are_those_along_a_bent_joint(seed):
    """Fold-folds in the plane of an angle: their stability is of third order in the orbits."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.2, 1.0, 2)
    p, q, s, e = rng.uniform(-1, 1, 4)
    angle, rate = ca.SX.sym("angle"), ca.SX.sym("rate")

    def sides(q1, q2):
        above = (1.0 + p * q2, -a * q1 + q * q1**2 + s * q2)
        below = (-1.0 + e * q2, -b * q1 + p * q1**2 + e * q2)
        return above, below

    above, below = sides(angle, rate)
    plain = ns.FilippovSystem([angle, rate], surface=rate, above=above, below=below)
    around = ns.Constraint(x**2 + y**2 - 1, reaction=r)
    q1, q2 = ca.atan2(y, x), z
    f1, f2 = sides(q1, q2)
    mixed = [(f1[i] + f2[i]) / 2 + lam * (f1[i] - f2[i]) / 2 for i in (0, 1)]
    joint = ns.FilippovSystem(
        [x, y, z],
        field=[-y * mixed[0] + r * x, x * mixed[0] + r * y, mixed[1]],
        surfaces=[z],
        multipliers=[lam],
        constraints=around,
    )
    one, other = ns.classify(joint, [1.0, 0.0, 0.0]), ns.classify(plain, [0.0, 0.0])
    assert (one.kind, one.label) == (other.kind, other.label) == ("fold-fold", "II2")
    assert one.evidence["stability"] == pytest.approx(other.evidence["stability"], abs=1e-11)


def test_points_off_a_joint_and_points_of_several_elements():
    joint, _ = _pendulums(lambda q, s: -0.3, lambda q, s: s - 0.1)
    with pytest.raises(ns.PointError, match=r"constraint 'rod' is 0\.21"):
        ns.classify(joint, [1.1, 0.0, 0.0, 0.1])
    with pytest.raises(ns.PointError, match="rate of a constraint"):
        ns.classify(joint, [1.0, 0.0, 0.3, 0.1])
    with pytest.raises(ns.OptionError, match="one letter for each"):
        ns.find_fold(joint, [1.0, 0.0, 0.0, 0.1])
    corner = ns.FilippovSystem(
        [x, y],
        field=[u - y, w - x + 0.3],
        complementarity=[ns.Complementarity(x, u, "a"), ns.Complementarity(y, w, "b")],
    )
    with pytest.raises(ns.PointError, match="the condition 'a' and the condition 'b'"):
        ns.classify(corner, [0.0, 0.0])
    assert ns.classify(corner, [0.0, 0.0], mode="oo", surface=1).kind == "leaving"


def test_the_paradox_of_painleve_has_no_motion():
    rod = ns.textbook.painleve_rod()
    found = ns.classify(rod.system, rod.start)
    assert found.kind == "closed"
    expected = 1 / (1 + 3 * math.cos(1) * (math.cos(1) - math.sin(1)))
    assert found.evidence["multiplier"] == pytest.approx(expected, rel=1e-12)
    with pytest.raises(ns.PointError, match="no motion continues there"):
        ns.classify(rod.system, rod.start, parameters={"mu": 2.0})


def test_a_point_off_the_surface_beside_a_closed_diode_is_refused_with_the_nearest_one():
    boost = ns.textbook.boost_converter()
    with pytest.raises(
        ns.PointError, match=r"nearest point of the surface is about \[0.0, 3.5, 0.3\]"
    ):
        ns.classify(boost.system, [0.0, 3.5, 0.5], mode="+c")


def test_diodes_of_a_bridge_change_in_pairs():
    bridge = ns.textbook.diode_bridge().system
    assert [bridge.switching(i).kind for i in range(4)] == ["continuous"] * 2 + ["undecided"] * 2
    assert "open and close together" in str(bridge.switching(2))
    with pytest.raises(ns.DefinitionError, match=r"'[ac]': it opens and closes with others only"):
        ns.classify(bridge, [0.0, 0.1], mode="coco")


def test_corners_impacts_beside_rest_and_what_leaves_no_direction():
    pressed = ns.FilippovSystem(
        [x, y],
        field=[u - 1, w - 2],
        complementarity=[ns.Complementarity(x, u, "a"), ns.Complementarity(y, w, "b")],
    )
    found = ns.classify(pressed, [0.0, 0.0])
    assert (found.kind, found.label) == ("equilibrium", "stable node")
    assert ns.find_equilibrium(pressed, [0.1, 0.1], mode="cc").kind == "stable node"
    assert ns.classify(pressed, [0.0, 0.5]).kind == "closed"
    room = ns.FilippovSystem(
        [x, y, v, w],
        field=[v, w, 0, -1],
        impacts=[ns.Impact(y, 0.5, name="floor"), ns.Impact(x, 0.5, name="wall")],
    )
    assert ns.classify(room, [0.0, 0.0, -1.0, 0.0]).kind == "impact"  # of the wall, on the floor
    assert ns.classify(room, [1.0, 0.0, 1.0, 0.0]).kind == "closed"
    with pytest.raises(ns.PointError, match="contact 'floor' and the contact 'wall'"):
        ns.classify(room, [0.0] * 4)


def test_joints_that_depend_on_one_another_and_friction_that_drops():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    rods = [
        ns.Constraint(x**2 + y**2 - 1, reaction=a, name="one"),
        ns.Constraint(2 * x**2 + 2 * y**2 - 2, reaction=b, name="two"),
    ]
    pull = [(a + 2 * b) * x - v, (a + 2 * b) * y - 1 - w]
    swing = ns.FilippovSystem([x, y, v, w], field=[v, w, *pull], constraints=rods)
    rest = ns.find_equilibrium(swing, [0.1, -1.0, 0.0, 0.0])
    assert rest.kind == "stable focus"
    np.testing.assert_allclose(rest.point, [0, -1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(abs(rest.eigenvalues), 1.0, atol=1e-12)  # z^2 + z + 1
    assert ns.classify(swing, rest.point).label == "stable focus"
    dry = ns.Friction(v, load=r, kinetic=0.3, static=0.5)
    block = ns.FilippovSystem(
        [x, y, v, w],
        field=[v, w, dry.force - x, r - 1],
        surfaces=[dry],
        impacts=ns.Impact(y, reaction=r),
    )
    with pytest.raises(ns.DefinitionError, match="hidden"):
        ns.classify(block, [0.0] * 4)
    skate = ns.FilippovSystem(
        [x, y, z, v, w],
        field=[v, w, 1, -r * ca.sin(z), r * ca.cos(z)],
        constraints=ns.Constraint(w * ca.cos(z) - v * ca.sin(z), reaction=r),
    )
    with pytest.raises(ns.PointError, match=r"inside a mode, received the field \[(1.0|0.99)"):
        ns.classify(skate, [0, 0, 0, 1, 0])
