"""Systems whose orbits are proven, and the comparison of an enclosure with an exact value."""

import casadi as ca
import mpmath

import nonsmooth as ns

x, y, z, u, v, a, b, mu, t = (ca.SX.sym(s) for s in ("x", "y", "z", "u", "v", "a", "b", "mu", "t"))

STICK = ns.FilippovSystem(
    [x, v], surface=v - 0.5, above=[v, -x - mu], below=[v, mu - x], parameters={mu: 1.0}
)
SPIN = ns.FilippovSystem([x, y], field=[y, -x], stops=[ns.Stop(y, 1, "turn")])
FOLD = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, -2], below=[z, -1, 1])
TEIXEIRA = ns.FilippovSystem([x, y, z], surface=x, above=[-y, 1, -2], below=[z, -1, 1 + 0.1 * y])
TRANSCENDENTAL = ns.FilippovSystem(
    [x, y, z],
    surface=z + 0.1 * ca.sin(x * y),
    above=[1 + ca.exp(-y), ca.cos(z) - 0.4, ca.sin(2 * x) + ca.exp(y) / 2 - 0.6],
    below=[-1 + 0.2 * x, 1 + y * y, ca.atan(x - 0.3) + ca.log(1 + y * y + x * x) + 0.2 * y - 0.3],
)
PLANE = ns.FilippovSystem([x, y], surface=y, above=[y - x, x**2 - 2], below=[1, 1])
BALL = ns.FilippovSystem([y, v], field=[v, -1], impacts=ns.Impact(y, restitution=0.5))
TABLE = ns.FilippovSystem(
    [y, v], field=[v, -9.81], impacts=ns.Impact(y - 0.05 * ca.sin(7 * t), 0.8), time=t
)
#: Friction that is stronger for y > 0: the slider sticks on both sides, and y = t/2 - 1.
TWO = ns.FilippovSystem(
    [u, y], field=[0.25 - (1 + 0.5 * b) * a, 0.5], surfaces=[u, y], multipliers=[a, b]
)
BELT = ns.FilippovSystem(
    [x, v, y, u],
    field=[v, -x - 0.5 * a, u, -1],
    surface=v - 0.25,
    multipliers=a,
    impacts=ns.Impact(y, restitution=0.5),
)


def drop(stop):
    """A fall that comes back with half its speed."""
    return ns.FilippovSystem(
        [x, v],
        surface=x - 100,
        above=[v, 0],
        below=[v, -2],
        resets=[ns.Reset(x, [x, -0.5 * v], direction=-1, name="floor")],
        stops=[stop],
    )


def holds(enclosure, exact, slack=0):
    return mpmath.mpf(enclosure.low) - slack <= exact <= mpmath.mpf(enclosure.high) + slack
