"""A page to explore one bounce in a browser: cone, slip in time, outcome map and dividing curve."""

from __future__ import annotations

from pathlib import Path

import nonsmooth as ns

from .regions import COLOURS, MORE

WEB = Path(__file__).parent / "web"
#: What the page shows first: slip, rolling, and reverse slip at lift-off.
START = dict(
    mu=0.3, eta=0.5, d1=0.1, d2=0.1, G=0.0001, inertia=0.4, load="contact",
    xdot=0.6, ydot=-1.0, omega=0.9,
)  # fmt: skip
_SCRIPTS = ("contact.js", "maps.js", "bounce.js")


def explorer() -> str:
    """Return a page on which a landing is dragged over the map of what becomes of landings.

    Sliders set the surface, a :class:`bounce.KelvinVoigt` with Coulomb friction, and the landing. The
    friction cone, the slip in time, the numbers at lift-off, the outcome map and the dividing curve
    follow. The page is one file of HTML that needs no network: write it and open it in a browser, as
    ``bounce explore`` does. What it shows can be set in its address, after ``#``:
    ``mu=0.4&eta=1.2&xdot=1&omega=-0.5``.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> import pathlib
    >>> import bounce
    >>> page = bounce.plot.explorer()
    >>> pathlib.Path("bounce.html").write_text(page, encoding="utf-8")  # doctest: +SKIP
    >>> page.startswith("<!doctype html>"), "S+ R S-" in page
    (True, True)
    """
    data = dict(version=ns.__version__, start=START, colours=COLOURS, more=MORE)
    return ns.plot.offline_page(
        "Explore one bounce",
        _text("bounce.html"),
        styles=[_text("bounce.css")],
        scripts=[_text(name) for name in _SCRIPTS],
        data={"bounce": data},
    )


def _text(name: str) -> str:
    return (WEB / name).read_text(encoding="utf-8")
