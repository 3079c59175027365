"""Impacts of several contacts at once under each law, against all letters by linear algebra and closed forms."""

import itertools

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.differences import require

LAWS = ("newton", "moreau", "poisson")


def velocities(normals, tangents, weight, v, expected, mu, base):
    """All v+ with n v+ >= wanted perp p >= 0 and |p_t| <= mu (base + p), which opposes the slip."""
    found = []
    for letters in itertools.product("of", "+-s" if mu else "0", repeat=len(normals)):
        rows, forces, right, start = [], [], [], v
        for k, (normal, slip) in enumerate(zip(letters[::2], letters[1::2], strict=True)):
            n, t, side = normals[k], tangents[k], {"+": -mu, "-": mu}.get(slip, 0.0)
            start = start + weight @ t * base[k] * side
            rows += [n] * (normal == "f") + [t] * (slip == "s")
            right += [expected[k]] * (normal == "f") + [0.0] * (slip == "s")
            forces += [n + side * t] * (normal == "f") + [t] * (slip == "s")
        matrix = np.array(rows).reshape(-1, 3) @ weight @ np.array(forces).reshape(-1, 3).T
        p = np.linalg.lstsq(matrix, np.array(right) - np.array(rows).reshape(-1, 3) @ start)[0]
        after = start + weight @ np.array(forces).reshape(-1, 3).T @ p
        if rows and abs(np.array(rows) @ after - right).max() > 1e-9:
            continue
        holds, left, taken = True, list(p), np.zeros(len(normals))
        for k, (normal, slip) in enumerate(zip(letters[::2], letters[1::2], strict=True)):
            taken[k] = left.pop(0) if normal == "f" else 0.0
            holds &= taken[k] >= -1e-9 and normals[k] @ after >= expected[k] - 1e-9
            if slip == "s":
                holds &= abs(left.pop(0)) <= mu * (base[k] + taken[k]) + 1e-9
            elif slip in "+-":
                holds &= (tangents[k] @ after) * (1 if slip == "+" else -1) >= -1e-9
        if holds and not any(abs(after - own[0]).max() < 1e-7 for own in found):
            found.append((after, taken))
    return found


def struck(law, normals, tangents, weight, v, e, mu):
    """The velocities after an impact, all that the law allows."""
    rate, none = normals @ v, np.zeros(len(normals))
    if law == "moreau":
        expected = np.where(rate < 0, -e * rate, 0.0)
        return [own for own, _ in velocities(normals, tangents, weight, v, expected, mu, none)]
    found = []
    for between, taken in velocities(normals, tangents, weight, v, none, mu, none):
        moved = between + weight @ normals.T @ (e * taken)
        found += [
            own for own, _ in velocities(normals, tangents, weight, moved, none, mu, e * taken)
        ]
    return found


def body(law, normals, tangents, inertia, e, mu):
    """A planar body of unit mass whose gaps and slips are linear in position and velocity."""
    q, v = (ca.vertcat(*[ca.SX.sym(f"{name}{i}") for i in range(3)]) for name in "qv")
    count = len(normals)
    r, lam = ca.SX.sym("r", count), ca.SX.sym("lam", count)
    force = ca.mtimes(ca.DM(normals.T), r)
    if mu:
        force -= mu * ca.mtimes(ca.DM(tangents.T), lam * r)
    return ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(v)],
        field=[*ca.vertsplit(v), force[0], force[1], force[2] / inertia],
        surfaces=ca.vertsplit(ca.mtimes(ca.DM(tangents), v)) if mu else None,
        multipliers=ca.vertsplit(lam) if mu else None,
        impacts=[
            ns.Impact(gap, restitution=own, reaction=force, name=f"contact{i}", law=law)
            for i, (gap, own, force) in enumerate(
                zip(ca.vertsplit(ca.mtimes(ca.DM(normals), q)), e, ca.vertsplit(r), strict=True)
            )
        ],
    )


def random_body(seed, count):
    rng = np.random.default_rng(seed)
    points, angles = rng.uniform(-1, 1, (count, 2)), rng.uniform(0, 2 * np.pi, count)
    n = np.c_[np.cos(angles), np.sin(angles)]
    t = np.c_[-n[:, 1], n[:, 0]]
    turn = lambda d: points[:, 0] * d[:, 1] - points[:, 1] * d[:, 0]
    normals, tangents = np.c_[n, turn(n)], np.c_[t, turn(t)]
    v = rng.normal(size=3)
    while not (normals @ v < 0).all():
        v = rng.normal(size=3)
    return normals, tangents, float(rng.uniform(0.2, 0.6)), v


@pytest.mark.parametrize("law", ["moreau", "poisson"])
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(6))
def test_two_contacts_struck_at_once_are_as_all_letters_say(law, mu, seed):
    normals, tangents, inertia, v = random_body(seed, 2)
    e = np.array([0.7, 0.3])
    weight = np.diag([1.0, 1.0, 1 / inertia])
    expected = struck(law, normals, tangents, weight, v, e, mu)
    run = ns.simulate(body(law, normals, tangents, inertia, e, mu), [0, 0, 0, *v], 1e-9)
    first = run.events[0]
    assert first.kind == "impact" and first.t == 0.0
    assert min(abs(first.x_after[3:] - own).max() for own in expected) < 1e-9
    energy = lambda u: u @ np.linalg.solve(weight, u)
    assert law == "poisson" or energy(first.x_after[3:]) <= energy(v) + 1e-12


def chain(law, restitutions):
    """Balls of unit mass and size in a row."""
    n = len(restitutions) + 1
    q, v, r = (ca.SX.sym(name, count) for name, count in (("q", n), ("v", n), ("r", n - 1)))
    force = ca.vertcat(0, r) - ca.vertcat(r, 0)
    return ns.FilippovSystem(
        [*ca.vertsplit(q), *ca.vertsplit(v)],
        field=[*ca.vertsplit(v), *ca.vertsplit(force)],
        impacts=[
            ns.Impact(
                q[i + 1] - q[i] - 1, restitution=e, reaction=r[i], name=f"contact{i}", law=law
            )
            for i, e in enumerate(restitutions)
        ],
    )


@pytest.mark.parametrize(
    ("law", "restitutions", "after"),
    [
        ("newton", (1, 1), (-1 / 3, 2 / 3, 2 / 3)),
        ("moreau", (1, 1), (-1 / 3, 2 / 3, 2 / 3)),
        ("poisson", (1, 1), (-1 / 3, 2 / 3, 2 / 3)),
        ("newton", (0, 1), (1 / 3, 1 / 3, 1 / 3)),
        ("moreau", (0, 1), (1 / 3, 1 / 3, 1 / 3)),
        ("poisson", (0, 1), (1 / 6, 1 / 6, 2 / 3)),
        *[(law, (0.5,) * 4, (-0.2, 0.3, 0.3, 0.3, 0.3)) for law in LAWS],
        ("poisson", (0, 0, 0, 1), (0.15, 0.15, 0.15, 0.15, 0.4)),
    ],
)
def test_a_cradle_of_touching_balls(law, restitutions, after):
    """One ball strikes the others, which touch: closed forms with impulses in the ratio 4 : 3 : 2 : 1 (2 : 1)."""
    n = len(after)
    run = ns.simulate(chain(law, restitutions), [-0.5, *range(1, n), 1, *[0] * (n - 1)], 1.0)
    assert run.status is ns.Status.REACHED_END
    np.testing.assert_allclose(run.events[0].x_after[n:], after, atol=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_a_cradle_with_gaps_hands_the_speed_on(law):
    run = ns.simulate(chain(law, (1, 1, 1, 1)), [-0.5, 1.1, 2.2, 3.3, 4.4, 1, 0, 0, 0, 0], 3.0)
    assert [event.kind for event in run.events] == ["impact"] * 4 + ["end"]
    np.testing.assert_allclose(run.x[-1, 5:], [0, 0, 0, 0, 1], atol=1e-12)


@pytest.mark.parametrize(("seed", "fits"), [(1008, False), (1019, True), (1028, False)])
def test_three_contacts_with_friction_part_after_an_impact_or_have_none(seed, fits):
    """Sticking at all of them is more than three coordinates allow: it has no impulse of its own."""
    rng = np.random.default_rng(seed)
    v, normals = np.zeros(3), np.eye(3)
    while not (normals @ v < 0).all():
        points, angles = rng.uniform(-1, 1, (3, 2)), rng.uniform(0, 2 * np.pi, 3)
        n = np.c_[np.cos(angles), np.sin(angles)]
        t = np.c_[-n[:, 1], n[:, 0]]
        turn = lambda d, p=points: p[:, 0] * d[:, 1] - p[:, 1] * d[:, 0]
        normals, tangents = np.c_[n, turn(n)], np.c_[t, turn(t)]
        for _ in range(30):
            v = rng.normal(size=3)
            if (normals @ v < 0).all():
                break
    inertia = float(rng.uniform(0.2, 0.6))
    system = body("newton", normals, tangents, inertia, np.full(3, 0.6), 0.8)
    run = ns.simulate(system, [0, 0, 0, *v], 1e-9)
    if fits:
        assert (normals @ run.events[0].x_after[3:]).min() > -1e-9
    else:  # nor by Moreau's law, of all letters
        assert run.status is ns.Status.INCONSISTENT and "No impulse fits" in run.message
        weight = np.diag([1, 1, 1 / inertia])
        assert not struck("moreau", normals, tangents, weight, v, np.full(3, 0.6), 0.8)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("inertia", [0.5, 2.0])
def test_derivatives_pass_through_an_impact_beside_a_closed_contact(law, inertia):
    """The end of a bar that is at rest is struck too (inertia 1/2) or lifts off."""
    y, th, v, w, g = (ca.SX.sym(name) for name in ("y", "th", "v", "w", "g"))
    r, e = ca.SX.sym("r", 2), (0.6, 0.3)
    system = ns.FilippovSystem(
        [y, th, v, w],
        field=[v, w, r[0] + r[1] - g, (r[1] - r[0]) / inertia],
        impacts=[
            ns.Impact(y + side * th, restitution=e[i], reaction=r[i], name=name, law=law)
            for i, (side, name) in enumerate(((-1, "left"), (1, "right")))
        ],
        parameters={g: 9.81},
    )
    start = [0.3, 0.3, 0.0, 0.0]
    assert "impact" in [event.kind for event in ns.simulate(system, start, 0.5).events]
    require(system, start, 0.5, of=[4], within=1e-9)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("speed", [5.0, 0.5])
def test_derivatives_pass_through_an_oblique_impact(law, speed):
    """Friction slips throughout, or stops the slip of a disc within the impact."""
    x, y, u, v, w, lam, r, mu = (ca.SX.sym(n) for n in ("x", "y", "u", "v", "w", "lam", "r", "mu"))
    system = ns.FilippovSystem(
        [x, y, u, v, w],
        field=[u, v, -mu * lam * r, r - 9.81, -2 * mu * lam * r],
        surface=u + w,
        multipliers=lam,
        impacts=ns.Impact(y, restitution=0.5, reaction=r, law=law),
        parameters={mu: 0.3},
    )
    require(system, [0.0, 1.0, speed, 0.0, 0.0], 1.0, of=[2, 5], within=1e-9)


def test_all_impacts_have_one_law():
    q, v = ca.SX.sym("q", 2), ca.SX.sym("v", 2)
    states, field = [*ca.vertsplit(q), *ca.vertsplit(v)], [*ca.vertsplit(v), -1, -1]
    impact = lambda law, i: ns.Impact(q[i], name=f"floor{i}", law=law)
    with pytest.raises(ns.DefinitionError, match=r"different laws: 'moreau' for 'floor0' and 'po"):
        ns.FilippovSystem(states, field=field, impacts=[impact("moreau", 0), impact("poisson", 1)])
    with pytest.raises(ns.DefinitionError, match="law of 'floor0' is 'hertz'"):
        ns.FilippovSystem(states, field=field, impacts=impact("hertz", 0))
    one, two = (ns.FilippovSystem(states, field=field, impacts=impact(k, 0)) for k in LAWS[:2])
    assert one != two
    assert ns.FilippovSystem(states, field=field, impacts=impact("moreau", 0)) == two
