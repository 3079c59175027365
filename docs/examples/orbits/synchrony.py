"""Do coupled relay oscillators stay in step?

Three lags and a relay, $a' = -a - sgn c$, $b' = a - b$ and $c' = b - c$, oscillate. Equal ones are coupled
by the first lag in the row of the second, or by the second in the row of the first. The master stability function gives
the rate at which differences grow, for all networks at once: a network enters by the eigenvalues of strength times
Laplacian, 0 and $2s$ for a pair, 0, $3s$ and $3s$ for a ring of three, 0, $s$ and $3s$ for a chain. The first coupling
holds the oscillators in step up to the eigenvalue 1.28, the second from 1.87 on. Marks are rates in simulated networks.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

PAIR = np.array([[1, -1], [-1, 1]])
CHAIN = np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1]])
RING = 3 * np.eye(3) - 1

#: H(x), from the states a, b and c of a loop to its three rows.
COUPLINGS = {
    "first lag to second": lambda a, b, c: [0 * a, a, 0 * a],
    "second lag to first": lambda a, b, c: [b, 0 * a, 0 * a],
}


def network(laplacian, coupling):
    """Loops with the field f(x_i) - s sum L_ij H(x_j)."""
    a, b, c, relays = (ca.SX.sym(name, len(laplacian)) for name in ("a", "b", "c", "relay"))
    s = ca.SX.sym("s")
    own = ca.horzcat(-a - relays, a - b, b - c)
    pull = ca.mtimes(ca.DM(laplacian), ca.horzcat(*coupling(a, b, c)))
    return ns.FilippovSystem(
        ca.vertsplit(ca.vertcat(a, b, c)),
        field=ca.vertsplit(ca.vec(own - s * pull)),
        surfaces=ca.vertsplit(c),
        multipliers=ca.vertsplit(relays),
        parameters={s: 0.0},
    )


def simulated(laplacian, coupling, strength, mode):
    """Rate at which a difference along an eigenvector of the Laplacian grows, by runs over one period."""
    system, size = network(laplacian, coupling), 1e-6
    x, factors = orbit.trajectory(0.3 * orbit.period), []
    for kick in np.eye(3):
        start = np.outer(x, np.ones(len(mode))) + size * np.outer(kick, mode)
        run = ns.simulate(
            system, start.ravel(), orbit.period, parameters={"s": strength}, tol=1e-13
        )
        end = run.x[-1].reshape(3, -1)
        factors.append(((end - end.mean(axis=1, keepdims=True)) @ mode) / (size * mode @ mode))
    return np.log(np.abs(np.linalg.eigvals(factors)).max()) / orbit.period


alone = network([[0]], COUPLINGS["first lag to second"])
orbit = ns.periodic_orbit(alone, ns.simulate(alone, [1.0, 0.0, 0.1], 60.0))
kappa = np.linspace(-0.25, 3.75, 401)
states = ca.vertsplit(alone.extended_states)
curves = {
    name: ns.master_stability(orbit, coupling(*states), kappa).exponents
    for name, coupling in COUPLINGS.items()
}
#: Name, marker, Laplacian, eigenvector and eigenvalue of its modes.
NETWORKS = [
    ("a pair", "o", PAIR, [1, -1], 2),
    ("a ring of three", "s", RING, [1, -1, 0], 3),
    ("a chain of three, ends", "^", CHAIN, [1, 0, -1], 1),
    ("a chain of three, middle", "v", CHAIN, [1, -2, 1], 3),
]

figure = ns.plot.style.new_figure((6.6, 4.2))
ax = figure.subplots()
ax.axhline(0.0, color=ns.plot.style.GREY, linewidth=0.8)
rates = []
for (name, coupling), color in zip(
    COUPLINGS.items(), (ns.plot.style.BLUE, ns.plot.style.VERMILLION), strict=True
):
    ax.plot(kappa, curves[name], color=color, label=name)
    for number, (_, marker, laplacian, mode, eigenvalue) in enumerate(NETWORKS):
        for at in np.array([0.4, 1.0, 1.6, 2.2, 2.8]) + 0.15 * number:
            rate = simulated(laplacian, coupling, at / eigenvalue, np.array(mode))
            rates.append((name, at, rate))
            ax.plot(at, rate, marker, color=color, mfc="none")
for title, marker, *_ in NETWORKS:
    ax.plot([], [], marker, color=ns.plot.style.BLACK, mfc="none", label=title)
ax.set(xlabel="eigenvalue of strength times Laplacian", ylabel="growth rate of differences")
ax.legend(frameon=False)

if __name__ == "__main__":
    for name, at, rate in rates:
        print(name, at, rate, np.interp(at, kappa, curves[name]))
    figure.savefig("synchrony.png", dpi=110)
