"""All eight classes of two-folds

The generic two-folds, each by its sliding portrait and its flow in space, and at last where they lie in
the plane of $(nu1, nu2)$. Two signs and two numbers decide: which orbits reach the singularity, and
whether orbits are unique beyond it.
"""

import nonsmooth as ns

classes = {
    label: ns.two_folds.classify_two_fold(sigma, nu)
    for label, (sigma, nu) in ns.textbook.TWO_FOLDS.items()
}  # fmt: skip

figures = ns.plot.two_fold_atlas_pages(list(classes))

if __name__ == "__main__":
    for label, found in classes.items():
        print(f"{label:6} canards {found.canards:g}, faux canards {found.faux_canards:g}")
    for number, figure in enumerate(figures, 1):
        figure.savefig(f"atlas-{number}.pdf")
