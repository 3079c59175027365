"""A relay that slides more and more often

The orbit of a relay feedback, as its frequency $w$ grows: di Bernardo, Johansson & Vasca's multi-sliding orbit. A
slide is split in two where it touches the boundary of sliding (adding-sliding), and slides end where a flight
no longer reaches the surface (grazing-sliding). Each line is the duration of one slide of half a period; the
orbit is followed through all of these, stable all along.
"""

import numpy as np

import nonsmooth as ns

relay = ns.textbook.multi_sliding_relay()
run = relay.run({"w": 29.0}, t_end=60.0)
orbit = ns.periodic_orbit(relay.system, run, symmetry="odd", parameters={"w": 29.0})
branch = ns.continue_orbit(orbit, "w", bounds=(27.0, 37.0), step=0.1)

figure = ns.plot.style.new_figure((6.6, 4.6))
above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
solutions = list(zip(branch.values, branch.solutions, strict=True))
solutions += [(w, at) for w in np.linspace(27.01, 36.99, 160) for at in branch.at(w)]
for w, at in solutions:
    slides = [leg.duration for leg in at.legs if leg.mode == "s"]
    above.semilogy(np.full(len(slides), w), slides, ".", markersize=2.2, color=ns.plot.style.BLUE)
for event in branch.events:
    orange = event.kind == "grazing-sliding"
    color = ns.plot.style.ORANGE if orange else ns.plot.style.PURPLE
    for ax in (above, below):
        ax.axvline(event.parameter, color=color, linewidth=0.9, linestyle="-" if orange else "--")
ns.plot.branch(branch, ax=below, legend=False)
above.text(31.15, 2e-5, "adding-sliding", rotation=90, ha="right", va="bottom")
above.text(33.7, 2e-5, "grazing-sliding", rotation=90, va="bottom")
above.set(ylabel="durations of slides", title="slides of one period")
below.set(xlim=(27.0, 37.0), xlabel="frequency w", ylabel="period")

if __name__ == "__main__":
    print(branch)
    figure.savefig("relay.png", dpi=110)
