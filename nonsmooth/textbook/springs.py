"""Springs with gaps and other continuous fields, in which nothing slides."""

from __future__ import annotations

import casadi as ca

from ..model import FilippovSystem
from .problem import Problem, problem, stated


def soft_stop() -> Problem:
    """Forced oscillator with a spring behind a gap.

    $x'' + c x' + x + k max(x - 1, 0) = F cos w t$ with $c = 0.1$, $w = 0.8$, $k = 5$. The motion without contact
    touches the spring at $F = sqrt((1 - w^2)^2 + (c w)^2)$; the field is continuous there, so its multipliers, of
    modulus $exp(-c pi/w)$ until then, are so too.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: the soft impact oscillator of Ing, Pavlovskaia, Wiercigroch & Banerjee 2008, numbers chosen for this library; closed form.

    Examples
    --------
    >>> print(soft_stop().system.switching())
    continuous of order 1; nothing slides here (by exact arithmetic modulo a prime)
    """
    x, v, t, force = (ca.SX.sym(s) for s in ("x", "v", "t", "F"))
    push = force * ca.cos(0.8 * t) - 0.1 * v - x
    system = FilippovSystem.from_expression(
        [x, v], [v, push - 5 * ca.fmax(x - 1, 0)], time=t, parameters={force: 0.3}
    )
    return problem(
        soft_stop,
        system,
        (0.0, 0.0),
        100.0,
        stated("touch", "F at which the orbit touches the spring", "0.3687817782917154924"),
        stated(
            "modulus", "of the multipliers of the orbit without contact", "0.67523190665577721703"
        ),
        title="Soft stop behind a gap",
    )


def bilinear_oscillator() -> Problem:
    """Oscillator with two stiffnesses.

    $x'' = -x$ where $x < 0$ and $-4 x$ where $x > 0$: half periods $pi$ and $pi/2$, whatever the amplitude, and the
    amplitude to the right is half of that to the left.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Shaw & Holmes 1983, J. Sound Vib. 90, 129-155; closed form.

    Examples
    --------
    >>> bilinear_oscillator().run(t_end=5.0).itinerary
    '- + -'
    """
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    return problem(
        bilinear_oscillator,
        FilippovSystem([x, v], surface=x, above=[v, -4 * x], below=[v, -x]),
        (-1.0, 0.0),
        10.0,
        stated("period", "time between two crossings to the right", "4.7123889803846898577"),
        stated("amplitude to the right", "largest x", "0.5"),
        title="Bilinear oscillator",
    )


def backlash() -> Problem:
    """Mass between two springs with play, as a pair of gears with backlash.

    $x'' = -(x - 1)$ where $x > 1$, $-(x + 1)$ where $x < -1$, and 0 in between. From (0, 1/2) it crosses the play of 2
    with the speed 1/2 and turns round on each spring in the time $pi$: the period is $2 pi + 8$.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: after Kahraman & Singh 1990, J. Sound Vib. 142, 49-75, without load; closed form.

    Examples
    --------
    >>> backlash().run().itinerary
    '-+ ++ -+ -- -+'
    """
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    force = -ca.fmax(x - 1, 0) - ca.fmin(x + 1, 0)
    return problem(
        backlash,
        FilippovSystem.from_expression([x, v], [v, force]),
        (0.0, 0.5),
        14.0,
        stated("period", "time after which (0, 1/2) returns", "14.283185307179586477"),
        stated("amplitude", "largest x", "1.5"),
        title="Mass with backlash",
    )


def chua_circuit() -> Problem:
    """Chua's circuit, whose resistor has five pieces in books and three here.

    $x' = 9 (y - x - f(x))$, $y' = x - y + z$, $z' = -(100/7) y$ with $f = m_1 x + (m_0 - m_1)(abs(x + 1) - abs(x - 1))/2$,
    $m_0 = -8/7$, $m_1 = -5/7$. Equilibria are 0 and $x = -z = (m_1 - m_0)/(1 + m_1)$ on both sides; the double scroll
    turns round the outer ones.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: Chua, Komuro & Matsumoto 1986, IEEE Trans. Circuits Syst. 33, 1072-1118; roots of cubics.

    Examples
    --------
    >>> chua_circuit().system
    FilippovSystem(3 states: x, y, z; 2 surfaces (continuous of order 1): (x+1), (x-1))
    """
    x, y, z = (ca.SX.sym(s) for s in "xyz")
    inner, outer = -8 / 7, -5 / 7
    resistor = outer * x + (inner - outer) * (ca.fabs(x + 1) - ca.fabs(x - 1)) / 2
    system = FilippovSystem.from_expression(
        [x, y, z], [9 * (y - x - resistor), x - y + z, -100 / 7 * y]
    )
    return problem(
        chua_circuit,
        system,
        (0.1, 0.0, 0.0),
        50.0,
        stated("outer equilibrium", "its coordinates", "1.5", "0", "-1.5"),
        stated(
            "eigenvalues there",
            "the real one, then real and imaginary part of the pair",
            "-3.9421288953993572135",
            "0.18535016198539289249",
            "3.0469881248954652573",
        ),
        stated("unstable eigenvalue at 0", "the real one", "2.2173950459597073145"),
        title="Chua's circuit",
    )


def mckean_neuron() -> Problem:
    """McKean's piecewise linear neuron.

    $v' = f(v) - w + I$, $w' = 0.1 (v - w/2)$ with $f = -v$, $v - a$, $1 - v$, joined at $a/2$ and $(1 + a)/2$, $a = 1/4$.
    The equilibrium passes the first corner at $I = a/2 + a$, where it turns from a stable node or focus into an
    unstable one and a limit cycle begins.

    Returns
    -------
    Problem
        The system, a start, and the values that are known of it.

    Notes
    -----
    Source: McKean 1970, Adv. Math. 4, 209-223; equations with f continuous, numbers chosen for this library; closed form.

    Examples
    --------
    >>> mckean_neuron().system
    FilippovSystem(2 states: v, w; 2 surfaces (continuous of order 1): (v-0.125), (v-0.625); parameters: I)
    """
    v, w, current = ca.SX.sym("v"), ca.SX.sym("w"), ca.SX.sym("I")
    a = 0.25
    shape = -v + 2 * ca.fmax(v - a / 2, 0) - 2 * ca.fmax(v - (1 + a) / 2, 0)
    system = FilippovSystem.from_expression(
        [v, w], [shape - w + current, 0.1 * (v - w / 2)], parameters={current: 0.5}
    )
    return problem(
        mckean_neuron,
        system,
        (0.0, 0.0),
        100.0,
        stated("corner", "I at which the equilibrium is at v = a/2", "0.375"),
        stated("equilibrium", "v, w for I = 0.5", "0.25", "0.5"),
        stated("trace there", "sum of its eigenvalues", "0.95"),
        title="McKean's piecewise linear neuron",
    )
