"""Leine's oscillator

Friction that falls off with the slip velocity $u$ as $1/(1 + 3 |u|)$. Wherever it starts, once the
block has stuck it is on the same periodic orbit: sliding forgets the past, so one multiplier of the
cycle is zero.
"""

import numpy as np

import nonsmooth as ns

problem = ns.textbook.leine_stick_slip()
run = problem.run()
stick = next(s for s in run.segments[1:] if s.mode == "s")
exits = [event.t for event in run.events if event.kind == "exit"]
period = exits[1] - exits[0]
stick_time = stick.t_end - stick.t_start

starts = [[1.0, 0.2], [0.2, 0.1], [-1.0, 0.8], [1.6, 1.2], [0.0, -1.8]]
figure = ns.plot.phase_portrait(
    problem.system, (-2.0, 2.4, -2.0, 1.6), starts=np.array(starts), t_end=25.0, separatrices=False
)
ax = figure.axes[0]
cycle = run(np.linspace(exits[0], exits[1], 400))
ax.plot(*cycle.T, color=ns.plot.style.GREEN, linewidth=4.0, zorder=3.5)
ns.plot.style.arrowhead(ax, cycle, 0.35, "black", mutation_scale=18, zorder=3.6)
ax.annotate("the cycle", (0.1, -0.83), xytext=(0, -12), textcoords="offset points", va="top")

if __name__ == "__main__":
    print(problem["period"])
    print(f"computed {period:.15g}")
    figure.savefig("leine.png")
