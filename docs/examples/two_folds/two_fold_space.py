"""The flow around a two-fold in space

Above and below the surface orbits are arcs that come back. Two pairs of lines, the nonsmooth
diabolo, are mapped to themselves: along one, flights shrink to the two-fold, infinitely many in
finite time; along the other they grow. Beyond the first an orbit makes finitely many flights and
then slides; all others spiral away.
"""

import nonsmooth as ns

nu = (-2.0, -1.0)
expanding, contracting = ns.two_folds.diabolo_slopes(nu)
time_to_fold = ns.two_folds.accumulation_time(nu)  # along the contracting line, per |z2| = 1

figure = ns.plot.two_fold_3d(((-1, 1), nu))

if __name__ == "__main__":
    print(f"diabolo at |z3/z2| = {expanding:.9f} and {contracting:.9f}")
    print(f"infinitely many crossings in the time {time_to_fold:.12f}")
    figure.savefig("two_fold_space.png")
