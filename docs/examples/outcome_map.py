"""What becomes of a landing, and the curve that divides

Every point is a landing, its colour the itinerary of the bounce: slip (S+, S-) and rolling (R). On
the black curve the ball lifts off without slip. Along the solid part it rolls into the two-fold,
along the dashed part it slips up to the last moment; to one side it leaves with forward slip, to
the other in reverse.
"""

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

import bounce

turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)
speeds, spins = np.linspace(-2, 2, 400), np.linspace(-4, 4, 400)
map_ = bounce.outcome_map(turf, over={"xdot": speeds, "omega": spins}, progress=False)
curve = bounce.dividing_curve(turf, ydot=-1.0)

COLORS = dict(zip(map_.regions, ListedColormap(
    ["#E69F00", "#F0E442", "#0072B2", "#56B4E9", "#CC79A7", "#D55E00", "#009E73", "#BBBBBB"]
).colors, strict=False))  # fmt: skip

figure = Figure(figsize=(7.6, 5.4), layout="constrained")
ax = figure.add_subplot(xlabel="speed along the ground at touch-down", ylabel="spin at touch-down")
ax.pcolormesh(speeds, spins, map_.code, cmap=ListedColormap(list(COLORS.values())), rasterized=True)
for half in (1, -1):  # the curve is symmetric about rest
    ax.plot(*half * curve.two_fold.T, "k-", linewidth=2)
    ax.plot(*half * curve.slipping.T, "k--", linewidth=2)
    ax.plot(*half * curve.junction, "ko", markerfacecolor="white")
ax.set(xlim=(-2, 2), ylim=(-4, 4))
figure.legend(
    handles=[Patch(color=color, label=name) for name, color in COLORS.items()],
    loc="outside right upper",
)

if __name__ == "__main__":
    print(curve, map_.share())
    figure.savefig("outcome_map.png")
