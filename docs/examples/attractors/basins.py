"""Where a block comes to rest

A particle in a double well, with dry friction: it comes to rest in finite time, in the left well, in
the right well or on the hill between them, anywhere within reach of static friction. Ninety thousand
starts, integrated together; the colour says where each of them ends, darker after more swings.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

x, v, friction = ca.SX.sym("x"), ca.SX.sym("v"), ca.SX.sym("friction")
system = ns.FilippovSystem(
    states=[x, v],
    surface=v,
    above=[v, x - x**3 - friction],
    below=[v, x - x**3 + friction],
    parameters={friction: 0.08},
)
side = 300
starts = np.stack(np.meshgrid(np.linspace(-2, 2, side), np.linspace(-2, 2, side)), axis=-1)
many = ns.ensemble(system, starts, t_end=60.0, work=ns.Work(progress=False))

at_rest = np.array(["s" == word[-1] for word in many.itineraries])[many.itinerary_code]
where = np.digitize(many.x[..., 0], [-0.5, 0.5]) - 1  # -1 left, 0 on the hill, 1 right
swings = many.events["crossing"]
share = {name: float(np.mean(where == k)) for name, k in (("left", -1), ("hill", 0), ("right", 1))}

figure = ns.plot.style.new_figure((6.6, 5.6))
ax = figure.add_subplot(xlabel="x", ylabel="v")
hue = np.array([[0.00, 0.45, 0.70], [0.95, 0.90, 0.25], [0.84, 0.37, 0.00]])[where + 1]
light = 1 - 0.55 * swings[..., None] / swings.max()
ax.imshow(hue * light, origin="lower", extent=(-2, 2, -2, 2), interpolation="nearest")
for name, place in (("left well", -1.0), ("hill", 0.0), ("right well", 1.0)):
    box = dict(boxstyle="round", facecolor="white", edgecolor="none", alpha=0.8)
    ax.annotate(name, (place, 0.25), ha="center", va="center", bbox=box)
    ax.plot(place, 0.0, "k.")

if __name__ == "__main__":
    print(share, "all at rest:", at_rest.all(), "most swings:", swings.max())
    figure.savefig("basins.png")
