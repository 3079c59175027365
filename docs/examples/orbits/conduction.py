"""A boost converter, from continuous to discontinuous conduction

A clock switches a boost converter, and a diode (`ns.Complementarity`) keeps the current of its coil from becoming
negative. With $K = 2 L/(R T)$ falling the load becomes light, and one branch passes from continuous conduction, where the
gain is $1/(1 - D)$, to discontinuous conduction, where it is $(1 + sqrt(1 + 4 D^2/K))/2$ (circles; Erickson &
Maksimovic, Fundamentals of Power Electronics, chapter 5, for a large capacity). The border, a corner of the branch, is
followed in $D$ and $K$; the formula is $K = D (1 - D)^2$ (circles).
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

i, v, s, u, K, D, C = (ca.SX.sym(name) for name in ("i", "v", "s", "u", "K", "D", "C"))
clock = ns.Clock(1.0, name="tick")
off = (1 + s) / 2  # until the phase is D the switch is on
boost = ns.FilippovSystem(
    [i, v],  # input voltage, coil and period are 1
    field=[1 - off * v + u, (off * i - v * K / 2) / C],
    surfaces=[clock.phase - D],
    multipliers=[s],
    complementarity=ns.Complementarity(i, multiplier=u, name="diode"),
    clocks=clock,
    parameters={K: 0.3, D: 0.4, C: 100.0},
)
gain = 1 / (1 - 0.4)
orbit = ns.periodic_orbit(boost, [0.15 * gain**2 - 0.2, gain, 0.0])
branch = ns.continue_orbit(orbit, "K", bounds=(0.02, 0.3))
(border,) = branch.events
curve = ns.continue_bifurcation(border, ("D", "K"), bounds=[(0.03, 0.97), (0.001, 0.3)])
o = ns.orbit_functions(boost)
mean = o.integral("v") / o.period


def ideal(K, D=0.4):
    """Gain of an ideal boost converter with a large capacity."""
    return np.where(K > D * (1 - D) ** 2, 1 / (1 - D), (1 + np.sqrt(1 + 4 * D**2 / K)) / 2)


formula = dict(marker="o", ls="none", color=ns.plot.style.VERMILLION, ms=5, mfc="none", zorder=5)
figure = ns.plot.style.new_figure((7.0, 3.4))
left, right = figure.subplots(1, 2)
ns.plot.branch(branch, against=mean, ax=left)
loads = np.linspace(0.03, 0.29, 14)
left.plot(loads, ideal(loads), label="formula", **formula)
left.legend(frameon=False)
left.set(xlabel="K = 2L/(RT)", ylabel="mean output voltage", xlim=(0.0, 0.3))
right.plot(*curve.values.T, color=ns.plot.style.BLACK)
duties = np.linspace(0.05, 0.95, 19)
right.plot(duties, duties * (1 - duties) ** 2, **formula)
right.text(0.6, 0.13, "continuous")
right.text(0.36, 0.06, "discontinuous", ha="center")
right.set(xlabel="duty D", ylabel="K", xlim=(0.0, 1.0), ylim=(0.0, 0.2))

if __name__ == "__main__":
    print(branch, border, sep="\n")
    figure.savefig("conduction.png", dpi=110)
