"""A page to explore one bounce in a browser: cone, slip in time, outcome map and dividing curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import casadi as ca
import numpy as np

import nonsmooth as ns

from ..contact.equations import Equations, contact_system, equations, free_system
from ..contact.model import ContactModel, LoadConvention
from ..contact.models import KelvinVoigt
from ..parameters import number
from ..shot.state import check_approach, require_model
from .regions import COLOURS, MORE

WEB = Path(__file__).parent / "web"
#: Content of the page without a model: slip, rolling, and reverse slip at lift-off.
TURF = KelvinVoigt(mu=0.3, eta=0.5, d1=0.1, d2=0.1, G=0.0001)
_SCRIPTS = ("contact.js", "maps.js", "pictures.js", "bounce.js")
#: Symbol, words, and the largest value of a slider.
_WORDS = {
    "mu": ("μ", "friction coefficient", 1.5),
    "eta": ("η", "stiffness along / normal (frequencies)", 3.0),
    "d1": ("d₁", "damping along the ground", 1.0),
    "d2": ("d₂", "damping normal to it", 1.0),
    "G": ("G", "gravity", 0.5),
}
#: Least values where zero is none, and largest ones.
_LEAST = {"> 0": 0.02, "in (0, 1]": 0.02}
_MOST = {"in (0, 1]": 1.0, "in [0, 1]": 1.0}


def explore(
    model: ContactModel | None = None,
    xdot: float = 0.6,
    ydot: float = -1.0,
    omega: float = 0.9,
    *,
    parameters: Mapping[str, Sequence[float]] | None = None,
    title: str = "One bounce: drag the landing, turn the surface",
    path: str | Path | None = None,
) -> ns.plot.ExplorerPage:
    """Make a page on which a landing is dragged over the map of what becomes of landings.

    Sliders set the surface and the landing. The ball that slips and rolls, its point in the friction cone, the slip
    in time, the numbers at lift-off, the outcome map and the dividing curve follow. The page is one file that needs
    no network, with the driver of :func:`bounce.simulate`. What it shows can be set in its address, after
    ``#``: ``mu=0.4&eta=1.2&xdot=1&omega=-0.5``.

    Parameters
    ----------
    model : ContactModel, optional
        A surface in the plane; by default a :class:`bounce.KelvinVoigt`.
    xdot, ydot, omega : float, optional
        The landing at first.
    parameters : mapping, optional
        Ranges (low, high) of sliders, by name of the parameter.
    title : str, optional
        Title of the page.
    path : str or Path, optional
        File to write.

    Returns
    -------
    nonsmooth.plot.ExplorerPage
        The page, with ``html``, ``save(path)`` and ``open()``.

    Raises
    ------
    ModelError
        What is no contact model in the plane.
    LandingError
        A landing that does not approach the ground.
    OptionError, ParameterError
        A range that is empty; an unknown parameter.

    Examples
    --------
    >>> import bounce
    >>> page = bounce.explore(bounce.KelvinVoigt(mu=0.4, d1=0.1, d2=0.2, eta=0.8), xdot=1.0, omega=0.2)
    >>> page.save("bounce.html")  # doctest: +SKIP
    >>> len(page.html) < 2_000_000
    True
    """
    model = TURF if model is None else model
    require_model(model)
    check_approach(0.0, number(ydot, "ydot"))
    landing = dict(xdot=float(xdot), ydot=float(ydot), omega=float(omega))
    eq, sliders = equations(model.blueprint()), _sliders(model, parameters or {})
    systems = {
        f"{load}-{part}": system
        for load, own in _conventions(model).items()
        for part, system in _systems(own).items()
    }
    data = dict(
        title=title,
        version=ns.__version__,
        model=type(model).__name__,
        parameters=list(model.values),
        start={**model.values, **landing, "load": model.convention},
        loads=[*_conventions(model)],
        sliders=sliders,
        further=list(eq.start.values()),
        mirrored="slope" not in {own["name"] for own in sliders} and _turns(eq),
        reach=[max(3.0, 1.5 * abs(landing["xdot"])), max(6.0, 1.5 * abs(landing["omega"]))],
        colours=COLOURS,
        more=MORE,
    )
    page = ns.plot.offline_page(
        title,
        _text("bounce.html"),
        styles=[_text("bounce.css")],
        scripts=[_text(name) for name in _SCRIPTS],
        data={"bounce": data},
        systems=systems,
    )
    made = ns.plot.ExplorerPage(page, title)
    if path is not None:
        made.save(path)
    return made


def _text(name: str) -> str:
    return (WEB / name).read_text(encoding="utf-8")


def _conventions(model: ContactModel) -> dict[str, ContactModel]:
    """The model with each convention of the load, if it leaves the load to them."""
    if type(model).load is not ContactModel.load:
        return {model.convention: model}
    conventions: tuple[LoadConvention, ...] = get_args(LoadConvention)
    return {load: model.replace(load=load) for load in conventions}


def _systems(model: ContactModel) -> dict[str, ns.FilippovSystem]:
    """The systems that the page integrates: the contact, the phase before it, and the load as the function of a stop."""
    blueprint = model.blueprint()
    eq = equations(blueprint)
    states = list(eq.x.values())
    forces = ns.FilippovSystem(
        states,
        field=[0.0] * len(states),
        parameters=list(eq.p.values()),
        stops=[ns.Stop(eq.load, -1, "load")],
    )
    return {"touching": contact_system(blueprint), "free": free_system(blueprint), "forces": forces}


def _sliders(model: ContactModel, ranges: Mapping[str, Sequence[float]]) -> list[dict[str, Any]]:
    """A slider for each parameter of the surface; the ball's moment of inertia has a list."""
    unknown = sorted(set(ranges) - set(model.values))
    if unknown:
        raise ns.ParameterError(
            f"parameters has {unknown}, but {type(model).__name__} has {list(model.values)}."
        )
    limits, sliders = model.limits_of_values(), []
    for name, value in model.values.items():
        if name == "inertia" or (name == "slope" and not value and name not in ranges):
            continue
        symbol, words, most = _WORDS.get(name, (name, "", 2.0 * abs(value) or 1.0))
        limit = limits.get(name, "")
        high = max(_MOST.get(limit, most), value)
        low = min(_LEAST.get(limit, 0.0) * high, value)
        if name in ranges:
            low, high = (number(one, f"parameters[{name!r}]") for one in ranges[name])
            if not low < high:
                raise ns.OptionError(f"parameters[{name!r}] is {ranges[name]!r}, an empty range.")
        sliders.append(dict(name=name, symbol=symbol, words=words, low=low, high=high))
    return sliders


def _turns(eq: Equations) -> bool:
    """Whether the mirror image of a motion along the ground is a motion, as it is without a slope."""
    turning = [k for k, n in enumerate(eq.names) if n in eq.along_the_ground | set(eq.vectors)]
    sign = np.ones((len(eq.names), 1))
    sign[turning] = -1.0
    rng = np.random.default_rng(0)
    x = rng.uniform(0.2, 0.9, (len(eq.names), 3))
    p = rng.uniform(0.2, 0.9, (len(eq.p), 3))
    x[2] *= -1.0
    p[[*eq.p].index("slope")] = 0.0
    forward, reverse = (eq.function([ca.vertcat(*eq.side(s))]) for s in (1.0, -1.0))
    one, other = ns.call(forward, x, p)[0], ns.call(reverse, sign * x, p)[0]
    return bool(np.allclose(sign * one, other, rtol=1e-9, atol=1e-12, equal_nan=True))
