"""Times of proofs in interval arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

import bounce
import nonsmooth as ns

from ..timing import alternate


def chebyshev(n: int, u: ca.SX) -> ca.SX:
    """T_n(u) by its recurrence; n simple zeros in (-1, 1)."""
    a, b = ca.SX(1), u
    for _ in range(n - 1):
        a, b = b, 2 * u * b - a
    return b


def two_fold() -> Callable[[], Any]:
    """A transcendental two-fold to 1e-30."""
    x, y, z = (ca.SX.sym(s) for s in "xyz")
    system = ns.FilippovSystem(
        [x, y, z],
        surface=z + 0.1 * ca.sin(x * y),
        above=[1 + ca.exp(-y), ca.cos(z) - 0.4, ca.sin(2 * x) + ca.exp(y) / 2 - 0.6],
        below=[
            -1 + 0.2 * x,
            1 + y * y,
            ca.atan(x - 0.3) + ca.log(1 + y * y + x * x) + 0.2 * y - 0.3,
        ],
    )
    fold = ns.find_two_fold(system, near=[0.257, -0.62, 0.016])
    return lambda: ns.certify(fold, width=1e-30)


def zeros(n: int) -> Callable[[], Any]:
    """All n^2 two-folds of a box on a curved surface."""
    x, y, z = (ca.SX.sym(s) for s in "xyz")
    system = ns.FilippovSystem(
        [x, y, z],
        surface=z + 0.1 * x * y,
        above=[0, 0, chebyshev(n, x)],
        below=[0, 0, chebyshev(n, y)],
    )
    return lambda: ns.prove_all(system, [(-1.5, 1.5), (-1.5, 1.5), (-1, 1)])


def one_bounce(model: bounce.ContactModel) -> Callable[[], Any]:
    """A bounce with its itinerary."""
    return lambda: bounce.certify(model, xdot="0.1", ydot=-1, omega=1)


def run(quick: bool) -> dict[str, Any]:
    """Time each proof, and check that it is one."""
    side = 4 if quick else 10
    linear = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    soft = bounce.contact.DepthDampedKelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
    work = {
        "a two-fold with its class, to 1e-30": two_fold(),
        "a linear bounce": one_bounce(linear),
        "a nonlinear bounce": one_bounce(soft),
        f"all {side * side} two-folds of a box": zeros(side),
    }
    results = {name: prove() for name, prove in work.items()}
    timings = alternate(work, 3 if quick else 7)
    found = {
        name: t.as_dict() | {"proven": bool(getattr(r, "proven", getattr(r, "complete", False)))}
        for (name, t), r in zip(timings.items(), results.values(), strict=True)
    }
    print(f"  {found}", flush=True)
    return found
