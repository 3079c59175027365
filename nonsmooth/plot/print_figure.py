"""A figure whose files are fit for print."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

#: TrueType fonts, which publishers take and whose text can be searched and edited; Type 3 otherwise.
_FONTS: Any = {"pdf.fonttype": 42, "ps.fonttype": 42}
_LAYOUTS = 5  # at most: three do so far


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
            self._settle()
            super().savefig(fname, **options)

    def _settle(self) -> None:
        """Lay out until nothing moves: titles and square axes know their heights only when drawn."""
        before = list[tuple[int, ...]]()
        for _ in range(_LAYOUTS):
            self.draw_without_rendering()
            after = [tuple(map(round, map(float, axes.bbox.bounds))) for axes in self.axes]
            if after == before:
                return
            before = after
