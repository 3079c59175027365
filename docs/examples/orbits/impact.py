"""An oscillator that begins to hit a wall

A forced oscillator before a wall at $x = 1$. Where its orbit first touches the wall (an impact grazing) the
return map has a square root: stability is lost at once. Lines are continued, broken where they are
unstable: orbits of one forcing period that never hit, and that hit once, and what doubles from them. Dots
are long runs with a thousand periods of transients, from the state at the touch. Triangle: the touch;
squares: doublings; circles: folds. The orbits of four periods are continued to $F = 4.3$.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

x, v, t, F = (ca.SX.sym(name) for name in ("x", "v", "t", "F"))
w, damping = 2.2, 0.05
system = ns.FilippovSystem(
    [x, v],
    field=[v, F * ca.cos(w * t) - x - 2 * damping * v],
    parameters={F: 3.5},
    time=t,
    impacts=ns.Impact(1 - x, restitution=0.8, name="wall"),
)
size = np.hypot(1 - w * w, 2 * damping * w)  # at this force the free response has the amplitude one
free = 0.95 * size / (1 - w * w + 2j * damping * w)
orbit = ns.periodic_orbit(system, [free.real, (1j * w * free).real], parameters={"F": 0.95 * size})
bounds = (0.95 * size, 1.25 * size)
single = ns.continue_orbit(orbit, "F", bounds=bounds)
grazing = next(e for e in single.events if e.kind == "impact grazing")
doubling = [e for e in single.events if e.kind == "period doubling"][-1]
double = ns.continue_orbit(doubling, "F", bounds=bounds)

period = 2 * np.pi / w
forces = np.linspace(0.96, 1.25, 241) * size
response = np.minimum(forces, 0.999 * size) / (1 - w * w + 2j * damping * w)
starts = np.column_stack([response.real, (1j * w * response).real])
many = ns.ensemble(
    system,
    starts,
    1080.5 * period,
    parameters={"F": forces},
    at=ns.Section(period, skip=1000, count=80),
    work=ns.Work(progress=False),
)

hits = ns.periodic_orbit(
    system,
    ns.simulate(system, starts[-1], 900 * period, parameters={"F": 3.9}),
    parameters={"F": 3.9},
)
several = ns.continue_orbit(hits, "F", bounds=(3.7, 4.3))

figure = ns.plot.style.new_figure((6.6, 4.2))
ax = figure.subplots()
ax.plot(np.repeat(forces, 80), many.sample_x[..., 0].ravel(), **ns.plot.style.CLOUD)


def strobed(k):
    """The displacement at the k-th period of the force."""

    def displacement(orbit):
        run = orbit.trajectory
        span = run.t[-1] - run.t[0]
        return float(run(run.t[0] + (k * period - run.t[0]) % span)[0])

    return displacement


ns.plot.branch(single, against=strobed(0), ax=ax)
for k in range(2):
    ns.plot.branch(double, against=strobed(k), ax=ax)
for k in range(4):
    ns.plot.branch(several, against=strobed(k), ax=ax)
ax.text(3.75, -1.32, "never hits", ha="center")
ax.text(4.55, -2.1, "hits once a period")
ax.text(3.845, 0.75, "four periods", ha="center")
ax.set(xlim=bounds, xlabel="force F", ylabel="displacement x once a period")

if __name__ == "__main__":
    print(single, double, several, dict(grazing.coefficients))
    figure.savefig("impact.png", dpi=110)
