"""Where friction in the plane lets go

Near slip $h = 0$ a body sees $h' = a - M u$, with the direction $u$ of its slip. Above left: the blow-up, direction
against distance, for a load that friction holds ($M = c$, a number, and $|a| = 0.6 c$). All orbits end at distance $r = 0$, turned
towards the load. Beside it: paths of a block on an incline, from starts all round: where it holds they come
to rest along one limit direction; where it does not, all leave along it. Below: with friction of two
strengths four limit directions exist for loads inside the astroid, else two.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

v, lam = (ca.vertcat(ca.SX.sym(f"{n}1"), ca.SX.sym(f"{n}2")) for n in ("v", "lam"))
a1, a2, m1, m2 = (ca.SX.sym(name) for name in ("a1", "a2", "m1", "m2"))
block = ns.FilippovSystem(
    ca.vertsplit(v),
    field=[a1 - m1 * lam[0], a2 - m2 * lam[1]],
    surfaces=[v],
    multipliers=[lam],
    parameters={a1: 0.6, a2: 0.0, m1: 1.0, m2: 1.0},
)

STYLE = ns.plot.style
RESTS = dict(color=STYLE.ABOVE, linewidth=0.9)
GOES = dict(color=STYLE.BELOW, linewidth=0.9, linestyle="--")
figure = STYLE.new_figure((7.0, 6.0))
panels = figure.subplot_mosaic([["blown", "paths"], ["astroid", "astroid"]])
blown, paths, astroid = (panels[name] for name in ("blown", "paths", "astroid"))
angles = np.linspace(0.0, 2 * np.pi, 16, endpoint=False) + np.pi / 16
for angle in angles:
    start = [np.cos(angle), np.sin(angle)]
    run = ns.simulate(block, start, 10.0)
    stop = run.events[0].t
    h = run(stop * (1 - np.logspace(0, -5, 200)))
    phi = np.degrees(np.unwrap(np.arctan2(h[:, 1], h[:, 0])))
    blown.plot(phi, np.linalg.norm(h, axis=1), **RESTS)
    paths.plot(*h.T, **RESTS)
    slips = ns.simulate(block, start, 6.0, parameters={"a1": 1.5})
    goes = slips(np.linspace(0, 6.0, 400))
    paths.plot(*goes.T, **GOES)
    STYLE.arrowhead(paths, h, 0.4, STYLE.ABOVE, mutation_scale=9)
    STYLE.arrowhead(
        paths, STYLE.inside(goes, (-2, 2.1, -2, 2))[0], 0.5, STYLE.BELOW, mutation_scale=9
    )
    half = np.column_stack([phi, np.linalg.norm(h, axis=1)])
    STYLE.arrowhead(blown, half, 0.3, STYLE.ABOVE, scale=(360.0, 1.0), mutation_scale=9)
blown.plot(0, 0, "k.", markersize=10, clip_on=False, zorder=5)
blown.plot([-180, 180], [0, 0], "ko", markerfacecolor="white", clip_on=False, zorder=5)
blown.annotate("attracts", (0, 0), (8, 6), textcoords="offset points", path_effects=STYLE.halo())
blown.annotate("repels", (-180, 0), (8, 6), textcoords="offset points", path_effects=STYLE.halo())
blown.set(
    xlabel="direction of slip, degrees from the load",
    ylabel="slip |h|",
    xticks=range(-180, 181, 90),
)
blown.set(xlim=(-180, 180), ylim=(0, 1))
directions = ns.local.limit_directions(block, [0.0, 0.0])
paths.plot([], [], label="a = 0.6 c: comes to rest", **RESTS)
paths.plot([], [], label="a = 1.5 c: continues", **GOES)
paths.plot(0, 0, "k.", zorder=5)
paths.set(xlabel="$h_1$", ylabel="$h_2$", xlim=(-1.1, 2.1), ylim=(-1.2, 1.6))
paths.legend(loc="upper left", frameon=False, fontsize=8)

loads = np.linspace(-2.0, 2.0, 41) + 1e-3
strengths = {"m1": 2.0, "m2": 0.6}
counts = np.array(
    [
        [
            len(
                ns.local.limit_directions(
                    block, [0.0, 0.0], parameters={"a1": x, "a2": y, **strengths}
                )
            )
            for x in loads
        ]
        for y in loads
    ]
)
t = np.linspace(0, 2 * np.pi, 400)
width = strengths["m1"] - strengths["m2"]
astroid.contourf(loads, loads, counts, levels=[0, 3, 5], colors=["white", "0.85"])
astroid.plot(
    width * np.cos(t) ** 3,
    width * np.sin(t) ** 3,
    "k",
    solid_joinstyle="round",
    label="astroid: 4 inside, 2 outside",
)
astroid.plot(
    2.0 * np.cos(t),
    0.6 * np.sin(t),
    color=STYLE.BELOW,
    linestyle="--",
    label="sliding inside",
)
astroid.set(xlabel="$a_1$", ylabel="$a_2$", aspect="equal", xlim=(-2.3, 2.3), ylim=(-1.7, 1.7))
astroid.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), frameon=False, fontsize=8)

if __name__ == "__main__":
    print(directions)
    figure.savefig("plane_friction.png")
