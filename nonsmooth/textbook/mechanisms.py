"""Mechanisms with unilateral contacts, impacts and friction."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem, Impact
from ..model.definition.friction import Friction
from .problem import Problem, problem, stated

_EVENT_BY_EVENT = "state at t_end; integrated from event to event with scipy's DOP853"


def painleve_rod() -> Problem:
    """Rod that slides on its tip, and Painleve's paradox.

    A uniform rod of length and mass 1, under gravity 1, leans at the angle $a$ and slides with the friction $mu$ against
    its lean. It slides on with the reaction $1/(1 + 3 cos a (cos a - mu sin a))$; where that is negative, it can neither
    slide nor rise. The least such friction is $4/3$, at $tan a = 2$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Painleve 1895, C. R. Acad. Sci. 121, 112-115; Genot & Brogliato 1999, Eur. J. Mech. A 18, 653-677; closed form.

    Examples
    --------
    >>> painleve_rod().run().itinerary, painleve_rod().run({"mu": 2.0}).status.name
    ('-c sc', 'INCONSISTENT')
    """
    x, y, a, u, v, w, r, mu = (ca.SX.sym(s) for s in ("x", "y", "a", "u", "v", "w", "r", "mu"))
    friction = Friction(u + w * ca.sin(a) / 2, load=r, kinetic=mu)
    turn = 6 * (friction.force * ca.sin(a) - r * ca.cos(a))
    system = FilippovSystem(
        [x, y, a, u, v, w],
        field=[u, v, w, friction.force, r - 1, turn],
        surfaces=[friction],
        impacts=Impact(y - ca.sin(a) / 2, restitution=0, reaction=r, name="tip"),
        parameters={mu: 1.0},
    )
    return problem(
        painleve_rod,
        system,
        (0.0, 0.42073549240394825, 1.0, -1.0, 0.0, 0.0),
        0.5,
        stated("paradox", "mu from which the start has no motion", "1.3752593961307416808"),
        stated(
            "least friction",
            "mu from which this start has no motion",
            "1.3333333333333333333",
            at={"a": 1.1071487177940904, "y": 0.4472135954999579},
        ),
        stated("sticks (t, a)", "at the entry", "0.27999696936093218117", "1.1484037208067484930"),
        title="Sliding rod of Painleve",
    )


def woodpecker() -> Problem:
    """Woodpecker toy, which pecks its way down a pole.

    The sleeve has the height y and the angle p, the woodpecker the angle q; a spring joins both. The sleeve jams
    on the pole at two corners, the beak strikes with the restitution 1/2, and friction of 0.3 acts at all contacts.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Glocker & Studer 2005, Multibody Syst. Dyn. 13, 447-463, with the numbers of the Siconos example.

    Examples
    --------
    >>> [event.name for event in woodpecker().run(t_end=0.1).events if event.kind == "impact"]
    ['high', 'beak', 'high']
    """
    y, p, q, u, v, w, mu = (ca.SX.sym(s) for s in ("y", "p", "q", "u", "v", "w", "mu"))
    beak, low, high = (ca.SX.sym(s) for s in ("beak", "low", "high"))
    sleeve, bird, arm, reach, stiffness = 0.0003, 0.0045, 0.01, 0.015, 0.0056
    weight = sleeve + bird
    mass = ca.DM(
        [
            [weight, bird * arm, bird * reach],
            [bird * arm, 5e-9 + bird * arm**2, bird * arm * reach],
            [bird * reach, bird * arm * reach, 7e-7 + bird * reach**2],
        ]
    )
    spring = stiffness * (p - q)
    force = -9.81 * ca.vertcat(weight, bird * arm, bird * reach) + ca.vertcat(0, -spring, spring)
    tip, corner = arm + reach - 0.0201, 0.0031
    contacts = (
        (beak, tip - 0.0025 - 0.02 * q, u + arm * v + (reach - 0.0201) * w, 0.5),
        (low, 0.0006 + 0.0058 * p, u + corner * v, 0.0),
        (high, 0.0006 - 0.0058 * p, u + corner * v, 0.0),
    )
    frictions = [Friction(slip, load=r, kinetic=mu) for r, _, slip, _ in contacts]
    positions, rates = ca.vertcat(y, p, q), ca.vertcat(u, v, w)
    for (r, gap, slip, _), friction in zip(contacts, frictions, strict=True):
        force += r * ca.gradient(gap, positions) + friction.force * ca.gradient(slip, rates)
    system = FilippovSystem(
        [y, p, q, u, v, w],
        field=[u, v, w, *ca.vertsplit(ca.mtimes(ca.inv(mass), force))],
        surfaces=frictions,
        impacts=[
            Impact(gap, restitution=bounce, reaction=r, name=r.name())
            for r, gap, _, bounce in contacts
        ],
        parameters={mu: 0.3},
    )
    return problem(
        woodpecker,
        system,
        (0.0, -0.0006 / 0.0058, -0.2788, -0.3411, 0.0, -7.4583),
        0.3,
        stated(
            "end",
            _EVENT_BY_EVENT,
            *("-0.0413274161", "-0.1034482759", "-0.342373855"),
            *("-0.259184923", "0", "-8.34282414"),
        ),
        title="Woodpecker toy",
    )


def slider_crank(friction: bool = True) -> Problem:
    """Slider-crank mechanism whose slider has clearance in its guide.

    The crank has the angle a, the rod b, and the slider c; each corner of the slider may touch one of two walls
    0.052 apart, with the restitution 0.4 and the friction $mu$. The crank starts with 150 rad/s and drives nothing.

    Parameters
    ----------
    friction : bool, optional
        Without it there are four contacts and nothing slides.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Flores, Leine & Glocker 2010, Multibody Syst. Dyn. 23, 165-190, with the numbers of the Siconos example.

    Examples
    --------
    >>> next(event.name for event in slider_crank().run(t_end=0.02).events if event.kind == "impact")
    'upper left'
    """
    a, b, c, u, v, w, mu = (ca.SX.sym(s) for s in ("a", "b", "c", "u", "v", "w", "mu"))
    crank, rod, length, height, half, g = 0.153, 0.306, 0.05, 0.025, 0.026, 9.81
    m1, m2, m3 = 0.038, 0.038, 0.076
    angles, rates = ca.vertcat(a, b, c), ca.vertcat(u, v, w)
    coupling = (m2 / 2 + m3) * crank * rod
    m11, m22 = 7.4e-5 + (m1 / 4 + m2 + m3) * crank**2, 5.9e-4 + (m2 / 4 + m3) * rod**2
    m12 = coupling * ca.cos(b - a)
    force = ca.vertcat(
        -coupling * ca.sin(a - b) * v**2 - (m1 / 2 + m2 + m3) * g * crank * ca.cos(a),
        coupling * ca.sin(a - b) * u**2 - (m2 / 2 + m3) * g * rod * ca.cos(b),
        0,
    )
    across, along = crank * ca.sin(a) + rod * ca.sin(b), crank * ca.cos(a) + rod * ca.cos(b)
    impacts, frictions = [], []
    for side, wall in ((1, "upper"), (-1, "lower")):
        for end, where in ((-1, "left"), (1, "right")):
            name = f"{wall} {where}"
            r = ca.SX.sym(name)
            corner = across + end * length * ca.sin(c) + side * height * ca.cos(c)
            gap = half - side * corner
            path = along + end * length * ca.cos(c) - side * height * ca.sin(c)
            slip = ca.jtimes(path, angles, rates)
            force += r * ca.gradient(gap, angles)
            impacts.append(Impact(gap, restitution=0.4, reaction=r, name=name))
            if friction:
                frictions.append(Friction(slip, load=r, kinetic=mu))
                force += frictions[-1].force * ca.gradient(slip, rates)
    det = m11 * m22 - m12**2
    known = ("18.0811240", "0.35351474", "0", "70.772736", "-28.584654", "0")
    if not friction:
        known = ("18.1742133", "0.31447231", "0", "77.578085", "-31.064448", "0")
    system = FilippovSystem(
        [a, b, c, u, v, w],
        field=[
            *(u, v, w),
            (m22 * force[0] - m12 * force[1]) / det,
            (m11 * force[1] - m12 * force[0]) / det,
            force[2] / 2.7e-6,
        ],
        surfaces=frictions or None,
        impacts=impacts,
        parameters={mu: 0.01} if friction else {},
    )
    return problem(
        slider_crank,
        system,
        (0.0, 0.0, 0.0, 150.0, -75.0, -0.01),
        0.2,
        stated("end", _EVENT_BY_EVENT, *known),
        title="Slider-crank mechanism with clearance",
    )
