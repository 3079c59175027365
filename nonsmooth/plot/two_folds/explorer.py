"""A browser page on which the class map, portrait and classification follow (nu1, nu2)."""

from __future__ import annotations

from typing import Any

from ...local.two_folds.classification import TABLE
from ..offline_page import WEB, installed_version, offline_page
from .atlas import CASES
from .class_map import REACH, SIGMA, areas, label_points


def two_fold_explorer() -> str:
    """Return a page on which $(nu1, nu2)$ is dragged over the class map of each kind of two-folds.

    The sliding portrait, its eigenlines and canards, the numbers and what the class means for
    uniqueness follow. The page is one file of HTML that needs no network: write it and open it in a
    browser, as ``python -m nonsmooth explore`` does. What it shows can be set in its address, after
    ``#``: ``folds=II&nu=-2,-1``.

    Returns
    -------
    str
        The page, as HTML.

    Examples
    --------
    >>> import pathlib
    >>> import nonsmooth as ns
    >>> page = ns.plot.two_fold_explorer()
    >>> pathlib.Path("two_folds.html").write_text(page, encoding="utf-8")  # doctest: +SKIP
    >>> page.startswith("<!doctype html>"), "II-C" in page
    (True, True)
    """
    parts = {name: (WEB / f"two_folds.{name}").read_text("utf-8") for name in ("html", "css", "js")}
    classes = (WEB / "classes.js").read_text("utf-8")
    return offline_page(
        "Explore two-folds",
        parts["html"],
        styles=[parts["css"]],
        scripts=[classes, parts["js"]],
        data={"two-folds": _data()},
    )


def _data() -> dict[str, Any]:
    """Data of the page: the decision table, its maps, and examples."""
    kinds = {sigma: kind for kind, sigma in SIGMA.items()}
    columns = ("label", "folds", "condition", "into", "out_of", "determinism")
    return dict(
        version=installed_version(),
        reach=REACH,
        table=[{column: getattr(row, column) for column in columns} for row in TABLE],
        areas={
            kind: [(label, polygon.round(4).tolist()) for label, polygon in areas(kind)]
            for kind in SIGMA
        },
        positions={kind: label_points(kind) for kind in SIGMA},
        cases=[(name, kinds[sigma], nu) for name, (sigma, nu) in CASES.items()],
    )
