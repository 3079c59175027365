"""A harvested population at its bifurcations

Predators are hunted only where there are more than $alpha$ of them. As $alpha$ rises, the equilibrium
with harvest becomes a pseudo-node (boundary node); the one without harvest frees itself from the
line and leaves a pseudo-saddle behind (boundary focus); at last pseudo-saddle and pseudo-node meet
and vanish (pseudo-saddle-node). Kuznetsov, Rinaldi & Gragnani 2003; parameters quoted from memory.
"""

import nonsmooth as ns

problem = ns.textbook.harvested_prey_predator()
values = {
    "boundary node": problem["boundary node"].value,
    "boundary focus": problem["boundary focus"].value,
    "saddle and node": 1.06,
    "pseudo-saddle-node": problem["pseudo-saddle-node"].value,
}
figure = ns.plot.style.new_figure((7.0, 7.6))
panels = dict(zip(values, figure.subplots(2, 2).T.flat, strict=True))
for name, ax in panels.items():
    ns.plot.phase_portrait(
        problem.system,
        (0.0, 1.1, values[name] - 0.5, values[name] + 0.5),
        parameters={"alpha": values[name]},
        ax=ax,
        legend=name == "saddle and node",
        labels=True,
        title=f"{name}, α = {values[name]:.4f}",
    )
    ax.set(xlabel="$x_1$", ylabel="$x_2$")

legend = panels["saddle and node"].get_legend()
figure.legend(handles=legend.legend_handles, loc="outside lower center", ncols=3, frameon=False)
legend.remove()

merged = ((1 - problem.parameters["b"]) / 2, values["pseudo-saddle-node"])
last = panels["pseudo-saddle-node"]
last.plot(*merged, "ks", fillstyle="left", markersize=8, zorder=9)
ns.plot.labels.Labels(last).name("pseudo-saddle-node", merged)

pseudo = [
    ns.find_pseudo_equilibrium(problem.system, near=[x1, 1.06], parameters={"alpha": 1.06})
    for x1 in (0.1, 0.6)
]

if __name__ == "__main__":
    print(values, *pseudo)
    figure.savefig("harvest.png")
