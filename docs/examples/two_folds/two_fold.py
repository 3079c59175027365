"""The sliding portrait of a two-fold

Where both fields are tangent to the surface the sliding field is 0/0. Here both folds are
invisible, and every orbit of attracting sliding (Da) reaches the two-fold in finite time: a
Teixeira singularity, class II-C. From there every orbit of repelling sliding (Dr) is a possible
continuation.
"""

import casadi as ca

import nonsmooth as ns

x, y, z = (ca.SX.sym(name) for name in "xyz")
system = ns.FilippovSystem(
    states=[x, y, z],
    surface=x,
    above=[-y, +1, -2],  # where x > 0
    below=[z, -1, 1 + 0.1 * y],  # where x < 0
)
fold = ns.find_two_fold(system, near=[0.0, 0.1, -0.1])

figure = ns.plot.two_fold(fold)

if __name__ == "__main__":
    print(fold)
    figure.savefig("two_fold.png")
