"""Every figure with its number and its caption."""

from __future__ import annotations

from matplotlib.figure import Figure

import nonsmooth as ns

from ..pictures import Picture
from . import figures_bounce, figures_data, figures_schematic, figures_space  # noqa: F401, they draw too
from .errata_general import fold_of
from .records import picture


@picture("Fig. 12 (b)")
def two_fold_b() -> Figure:
    """An invisible two-fold, nu = (-0.5, -0.5), which the library calls II-F. Grey lines: the orbits
    above the surface, projected on it. Dots: where an orbit that crossed comes to slide.
    """
    return ns.plot.two_fold_3d(((-1, 1), (-0.5, -0.5)))


@picture("Fig. 12 (c)")
def two_fold_c() -> Figure:
    """A visible-invisible two-fold, nu = (0, 0.5), which the library calls mix-0. Grey lines: the
    orbits above the surface, projected on it. Dots: where an orbit that crossed comes to slide.
    """
    return ns.plot.two_fold_3d(((1, 1), (0.0, 0.5)))


@picture("Fig. 13 (a)")
def visible_fp1() -> Figure:
    """Rolling near the ball's two-fold, in normal-form coordinates: one canard. The second
    eigenvalue is exactly 0 (erratum 18).
    """
    return ns.plot.two_fold(fold_of("linear"))


@picture("Fig. 13 (b)")
def visible_fp2() -> Figure:
    """The other visible portrait, nu1, nu2 > 0 and nu1 nu2 > 1. The ball's nu are negative, so it
    never has it.
    """
    return ns.plot.two_fold(((1, -1), (2.0, 1.0)))


def _number(one: Picture) -> tuple[int, str]:
    return int(one.label.split()[1]), one.label


PICTURES = tuple(sorted(picture, key=_number))
