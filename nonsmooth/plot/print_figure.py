"""A figure whose files are fit for print."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

#: TrueType fonts, which publishers take and whose text can be searched and edited; Type 3 otherwise.
_FONTS: Any = {"pdf.fonttype": 42, "ps.fonttype": 42}


class PrintFigure(Figure):
    """A figure that saves TrueType fonts into PDF and PostScript, whatever the user's settings, and
    whose layout has settled before it is saved."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save the figure.

        Parameters
        ----------
        fname : path or file
            Where to.
        **options
            Of ``matplotlib.figure.Figure.savefig``.
        """
        with mpl.rc_context(_FONTS):
            self.draw_without_rendering()  # the first layout does not know how high titles are
            super().savefig(fname, **options)
