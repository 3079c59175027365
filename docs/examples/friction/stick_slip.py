"""Stick and slip on a belt

A block on a spring, carried by a belt, with friction that weakens as it slips faster. It sticks
(mode `s`) until the spring is strong enough, slips back (mode `-`) and is caught again. Both fields
are linear, so the slip ends where a sum of exponentials vanishes; the period is known to any number
of digits.
"""

import casadi as ca

import nonsmooth as ns

x, v = ca.SX.sym("x"), ca.SX.sym("v")
belt, strength, weakening = (ca.SX.sym(name) for name in ("belt", "strength", "weakening"))
slip = v - belt
system = ns.FilippovSystem(
    states=[x, v],
    surface=slip,
    above=[v, -x - strength + weakening * slip],
    below=[v, -x + strength + weakening * slip],
    parameters={belt: 0.3, strength: 0.5, weakening: 0.2},
)
run = ns.simulate(system, [0.0, 0.0], t_end=30.0)
exits = [event for event in run.events if event.kind == "exit"]
period = exits[2].t - exits[1].t

figure = ns.plot.trajectory(run)

if __name__ == "__main__":
    print(run.itinerary, run.status)
    print(f"slips at x = {exits[-1].x[0]:.12f}; period {period:.12f}")
    figure.savefig("stick_slip.png")
