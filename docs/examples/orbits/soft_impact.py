"""A soft stop: through a grazing to period doublings

A forced oscillator before a spring at $x = 1$ that is 29 times as stiff as its own. The force is continuous there, so
where the orbit first touches the spring, at $A = |1 - w^2 + 2 i z w|$, its multipliers are continuous and the branch
goes through. Soon after it the period doubles, and doubles again: branches of one, two, four and eight periods of the
force, broken where they are unstable. Dots are long runs.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

x, v, t, A = (ca.SX.sym(name) for name in ("x", "v", "t", "A"))
w, z, stiffness = 0.85, 0.1, 29.0
free = A * ca.cos(w * t) - x - 2 * z * v
system = ns.FilippovSystem(
    [x, v],
    surface=1 - x,
    above=[v, free],
    below=[v, free - stiffness * (x - 1)],
    parameters={A: 0.3},
    time=t,
)
response = 1 / (1 - w * w + 2j * z * w)  # of the free oscillator to a unit force
touch = 1 / abs(response)
bounds = (0.985 * touch, 1.07 * touch)
start = bounds[0] * response * np.array([1, 1j * w])
orbit = ns.periodic_orbit(system, start.real, parameters={"A": bounds[0]})
single = ns.continue_orbit(orbit, "A", bounds=bounds)
doubling = next(e for e in single.events if e.kind == "period doubling")
double = ns.continue_orbit(doubling, "A", bounds=bounds)
second = next(e for e in double.events if e.kind == "period doubling")
four = ns.continue_orbit(second, "A", bounds=bounds)
third = next(e for e in four.events if e.kind == "period doubling")
eight = ns.continue_orbit(third, "A", bounds=bounds)

period = 2 * np.pi / w
forces = np.linspace(*bounds, 201)
many = ns.ensemble(
    system,
    start.real,
    640 * period,
    parameters={"A": forces},
    at=ns.Section(period, skip=600, count=40),
    work=ns.Work(progress=False),
)


def strobed(k):
    """The displacement at the k-th period of the force."""

    def displacement(orbit):
        run = orbit.trajectory
        span = run.t[-1] - run.t[0]
        return float(run(run.t[0] + (k * period - run.t[0]) % span)[0])

    return displacement


figure = ns.plot.style.new_figure((6.6, 4.4))
ax = figure.subplots()
ax.plot(np.repeat(forces, 40), many.sample_x[..., 0].ravel(), **ns.plot.style.CLOUD)
for branch, rounds in ((single, 1), (double, 2), (four, 4), (eight, 8)):
    for k in range(rounds):
        look = dict(events=rounds < 8, linewidth=1.2)
        ns.plot.branch(branch, against=strobed(k), ax=ax, **look)
ax.set(xlim=bounds, xlabel="force A", ylabel="displacement x once a period")

if __name__ == "__main__":
    print(single, double, four, eight, sep="\n")
    figure.savefig("soft_impact.png", dpi=110)
