"""Every figure with its number and its caption."""

from __future__ import annotations

from matplotlib.figure import Figure

import nonsmooth as ns

from .. import pictures
from . import figures_bounce, figures_data, figures_schematic, figures_space
from .errata_general import fold_of


def portrait_saddle() -> Figure:
    """Figure 13 (a): the sliding portrait of the ball's own two-fold."""
    return ns.plot.two_fold(fold_of("linear"))


def portrait_node() -> Figure:
    """Figure 13 (b): nu1, nu2 > 0 and nu1 nu2 > 1, which no ball has."""
    return ns.plot.two_fold(((1, -1), (2.0, 1.0)))


def invisible() -> Figure:
    """Figure 12 (b)."""
    return ns.plot.two_fold_3d(((-1, 1), (-0.5, -0.5)))


def visible_invisible() -> Figure:
    """Figure 12 (c)."""
    return ns.plot.two_fold_3d(((1, 1), (0.0, 0.5)))


_SPACE = (
    " Grey lines: the orbits above the surface, projected on it. Dots: where an orbit that crossed comes "
    "to slide."
)

PICTURES: tuple[pictures.Picture, ...] = (
    pictures.Picture(
        "setting_notation",
        "Fig. 2",
        "Notation. Counter-clockwise rotation, omega > 0, is backspin for a ball that moves right.",
        figures_schematic.setting_notation,
    ),
    pictures.Picture(
        "ics",
        "Fig. 3",
        "Ranges of the experiments (Table 1), dimensionless as printed. Dotted: the largest spin "
        "as it follows from the printed rpm. The measured points are not public.",
        figures_data.experiment_ranges,
    ),
    pictures.Picture(
        "tangential_velocity",
        "Fig. 4",
        "Simulated, not measured: the measurements are not public. Slip at lift-off against slip at "
        "touch-down, for 256 landings spread evenly over the ranges of Table 1. Circles: the "
        "paper's linear compliant model (d1 = 0.1, eta = 0.5, G = 0, with the r and mu that the "
        "companion experiments fitted). Crosses: the rigid law with the same r and mu; ticks: where it "
        "rolls at lift-off. Of the two "
        "classes that the paper describes, small negative slip appears in the compliant model on "
        "both surfaces, and never in the rigid law. Large positive slip appears in the rigid law "
        "on both, for few landings (at up to 1061/s on artificial turf and 1767/s on teeing turf). In the "
        "compliant model it appears on teeing turf, where 35 of 248 forward landings leave forward, at up to "
        "780/s, and not on artificial turf, where 16 of 248 do, at no more than 6/s.",
        figures_data.tangential_velocity,
    ),
    pictures.Picture(
        "trajectories",
        "Fig. 6",
        "Tangential and normal velocity during a rigid bounce (mu = 0.3, r = 0.6). Dots: touch-down; "
        "diamonds: lift-off.",
        figures_data.trajectories,
    ),
    pictures.Picture(
        "settings_kv",
        "Fig. 7",
        "The linear mechanism.",
        figures_schematic.settings_kv,
    ),
    pictures.Picture(
        "filippov_convexity",
        "Fig. 8",
        "F_s is the point of the line between the tips of F1 and F2 that lies in the surface. Drawn for "
        "attracting sliding: each field points at the surface, so F1, which holds above it, points "
        "down, behind it.",
        figures_schematic.filippov_convexity,
    ),
    pictures.Picture(
        "geometries",
        "Fig. 9",
        "What a bounce can do near lift-off, computed with the normal form of the linear ball's "
        "two-fold (mu = 0.3, d1 = d2 = 0.1, eta = 0.5, G = 1e-4): (a) forward slip throughout, (b) "
        "reverse slip throughout, (c, d) slip, roll, and slip again through a fold. Diamonds: "
        "lift-off. Dotted: from a start straight to the surface, at a cross. Pale: behind or below a "
        "surface.",
        figures_space.geometries,
    ),
    pictures.Picture(
        "kv_pert_a",
        "Fig. 10 (a)",
        "The end of bounces (A), (B), (C) in the friction cone. The paper gives mu and p0 only; "
        "here d1 = 0.098, d2 = 0.007, eta = 0.09, G = 0, and X'0 changed by -+0.02 with Omega0 = -X'0.",
        figures_bounce.kv_pert_cone,
    ),
    pictures.Picture(
        "kv_pert_b",
        "Fig. 10 (b)",
        "Slip velocity of the same bounces: (A) rolls to lift-off, (B) and (C) begin to slip 1e-4 "
        "before it.",
        figures_bounce.kv_pert_slip,
    ),
    pictures.Picture(
        "setting_generic",
        "Fig. 11",
        "The generalised mechanism.",
        figures_schematic.setting_generic,
    ),
    pictures.Picture(
        "two_fold_a",
        "Fig. 12 (a)",
        "The ball's visible two-fold with the lift-off surface. Thick: the only rolling orbit that "
        "reaches s. Orange: H > 0; blue, dashed: H < 0; black: rolling. Diamonds: lift-off, where every "
        "orbit but that one ends. Pale: behind or below a surface.",
        figures_space.two_fold_visible,
    ),
    pictures.Picture(
        "two_fold_b",
        "Fig. 12 (b)",
        "An invisible two-fold, nu = (-0.5, -0.5), which the library calls II-F." + _SPACE,
        invisible,
    ),
    pictures.Picture(
        "two_fold_c",
        "Fig. 12 (c)",
        "A visible-invisible two-fold, nu = (0, 0.5), which the library calls mix-0." + _SPACE,
        visible_invisible,
    ),
    pictures.Picture(
        "visible_fp1",
        "Fig. 13 (a)",
        "Rolling near the ball's two-fold, in normal-form coordinates: one canard. The second "
        "eigenvalue is exactly 0 (erratum 18).",
        portrait_saddle,
    ),
    pictures.Picture(
        "visible_fp2",
        "Fig. 13 (b)",
        "The other visible portrait, nu1, nu2 > 0 and nu1 nu2 > 1. The ball's nu are negative, so "
        "it never has it.",
        portrait_node,
    ),
)
