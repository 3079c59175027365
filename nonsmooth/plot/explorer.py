"""A page in the browser that runs a system: sliders, a start to drag, portrait, series, sweep."""

from __future__ import annotations

import html
import warnings
import webbrowser
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..flow import Status, simulate
from ..local.searches.find_two_fold import TwoFold
from ..model import Array, FilippovSystem, OptionError, ParameterError, raised_of, require_system
from .offline_page import WEB, installed_version, offline_page

_SCRIPTS = tuple(
    f"{name}.js" for name in "scan orbit sweep pictures portrait saving explore".split()
)
#: Share of the range of a run that is left free beside it.
_MARGIN = 0.2
#: Of a two-fold: how far from it the page reaches at first.
_NEAR_FOLD = 1.0


@dataclass(frozen=True)
class ExplorerPage:
    """A page of :func:`explore`; a notebook shows it.

    Attributes
    ----------
    html : str
        The page: one file that needs no network.
    title : str
        Its title.
    """

    html: str
    title: str

    def save(self, path: str | Path) -> Path:
        """Write the page and return its path.

        Parameters
        ----------
        path : str or Path
            File to write, for example ``"belt.html"``.

        Returns
        -------
        Path
            That file.
        """
        Path(path).write_text(self.html, encoding="utf-8")
        return Path(path)

    def open(self, path: str | Path = "explore.html") -> None:
        """Write the page and open it in the browser.

        Parameters
        ----------
        path : str or Path, optional
            File to write.
        """
        webbrowser.open(self.save(path).resolve().as_uri())

    def __repr__(self) -> str:
        return f"ExplorerPage({self.title!r}, {len(self.html) / 1000:.0f} kB)"

    def _repr_html_(self) -> str:
        """The page in a frame of a notebook."""
        inside = html.escape(self.html, quote=True)
        return f'<iframe srcdoc="{inside}" width="100%" height="820" style="border: 0"></iframe>'


def explore(
    system: FilippovSystem | TwoFold,
    start: ArrayLike | None = None,
    t_end: float = 30.0,
    *,
    parameters: Mapping[Any, Sequence[float]] | None = None,
    box: Sequence[float] | None = None,
    title: str = "",
    path: str | Path | None = None,
) -> ExplorerPage:
    """Make a page on which a system runs in the browser, by the library's own driver.

    A slider for each parameter, a start to drag, the orbit with its modes in colours, time series, itinerary and
    status, and a sweep over a parameter. For planar systems with one surface the page finds crossing and sliding
    segments, folds, equilibria and pseudo-equilibria; systems with three states or more are turned by dragging.
    The page is one file without a network. What it shows is in its address; "Copy as Python" gives the
    call of :func:`simulate` for it.

    Parameters
    ----------
    system : FilippovSystem or TwoFold
        Any system that :func:`simulate` takes, or a two-fold of one: the page then begins beside it.
    start : array_like (n,), optional
        Start of the orbit; by default the origin, with the first value of each discrete state.
    t_end : float, optional
        Time at which the orbit ends.
    parameters : mapping, optional
        Ranges (low, high) of sliders, by name or symbol. Other parameters have ranges around their values.
    box : sequence of float, optional
        Range of each state, (low, high, low, high, ...); by default around one run.
    title : str, optional
        Title of the page.
    path : str or Path, optional
        File to write.

    Returns
    -------
    ExplorerPage
        The page, with ``html``, ``save(path)`` and ``open()``.

    Raises
    ------
    DefinitionError, PointError
        ``system`` is none; a start that does not fit it.
    ParameterError
        An unknown parameter, or one without a value and without a range.
    OptionError
        A range that is empty or not finite, or a ``t_end`` that is not positive.

    Notes
    -----
    The page has the driver of :func:`simulate`, compiled to WebAssembly without fused operations, so that both give
    the same numbers to the last bit, up to rounding in functions such as sin.

    Examples
    --------
    A block on a belt sticks and slips:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, v, belt = (ca.SX.sym(name) for name in ("x", "v", "belt"))
    >>> system = ns.FilippovSystem(
    ...     [x, v], surface=v - belt, above=[v, -x - 0.4], below=[v, -x + 0.4], parameters={belt: 0.3})
    >>> page = ns.explore(system, start=[0.0, 0.0], parameters={"belt": (0.05, 1.0)})
    >>> page.save("belt.html")  # doctest: +SKIP
    >>> len(page.html) < 2_000_000
    True
    """
    if isinstance(system, TwoFold):
        system, start, box = _beside(system, start, box)
    require_system(system, sets=True, hysteresis=True, complementarity=True, joints=True)
    ranges = _ranges(system, parameters or {})
    sliders = _sliders(system, ranges)
    values = {slider["name"]: slider["value"] for slider in sliders}
    x0 = _usual(system) if start is None else start
    x0 = system.extended_point(x0)[: system.dimension]
    t_end = _positive(t_end)
    limits = _box(system, box) if box is not None else _around(system, x0, t_end, values)
    title = title or "A nonsmooth system"
    data = dict(
        title=title,
        version=installed_version(),
        sliders=sliders,
        start=x0.tolist(),
        t_end=t_end,
        box=limits.ravel().tolist(),
        **_surfaces(system),
        **_held(system),
        flow=system.dimension == 2 and not system.definition.discrete,
        events=bool(system.surface_count or system.impacts or system.resets),
        equations=system._repr_html_(),
        statuses={int(status): status.name for status in Status},
    )
    page = offline_page(
        title,
        _text("explore.html"),
        styles=[_text("explore.css")],
        scripts=[_text(name) for name in _SCRIPTS],
        data={"explorer": data},
        systems={"own": system},
    )
    made = ExplorerPage(page, title)
    if path is not None:
        made.save(path)
    return made


def _text(name: str) -> str:
    return (WEB / "explore" / name).read_text(encoding="utf-8")


def _beside(fold: TwoFold, start: Any, box: Any) -> tuple[FilippovSystem, Any, Any]:
    """System of a two-fold, a start beside it, and a box around it."""
    point = np.asarray(fold.point)
    reach = _NEAR_FOLD * np.ones(len(point))
    around = np.stack([point - reach, point + reach], axis=1).ravel()
    return (
        fold.system,
        point + 0.3 * reach if start is None else start,
        around if box is None else box,
    )


def _usual(system: FilippovSystem) -> Array:
    """The origin, with the first value of each discrete state."""
    first = [values[0] if values else 0.0 for values in system.definition.discrete]
    return np.array([0.0] * (system.dimension - len(first)) + first)


def _positive(t_end: float) -> float:
    if not (isinstance(t_end, (int, float, np.number)) and 0 < float(t_end) < np.inf):
        raise OptionError(f"t_end is {t_end!r}. Give a positive time.")
    return float(t_end)


def _pair(values: object, what: str) -> tuple[float, float]:
    """A range (low, high)."""
    pair = np.asarray(values, float)
    if pair.shape != (2,) or not np.isfinite(pair).all() or not pair[0] < pair[1]:
        raise OptionError(f"{what} is {values!r}. Give two numbers, the lower one first.")
    return float(pair[0]), float(pair[1])


def _ranges(
    system: FilippovSystem, given: Mapping[Any, Sequence[float]]
) -> dict[str, tuple[float, float]]:
    """Ranges by name of the parameter."""
    if not isinstance(given, Mapping):
        raise OptionError(f"parameters is {given!r}. Give a mapping of names to (low, high).")
    found = {str(name): _pair(pair, f"parameters[{str(name)!r}]") for name, pair in given.items()}
    unknown = sorted(set(found) - set(system.parameter_names))
    if unknown:
        raise ParameterError(
            f"parameters has {', '.join(map(repr, unknown))}, but the system has "
            f"{', '.join(system.parameter_names) or 'no parameters'}."
        )
    return found


def _sliders(
    system: FilippovSystem, ranges: Mapping[str, tuple[float, float]]
) -> list[dict[str, Any]]:
    """Name, value and range of each parameter; one without a value begins in the middle of its range."""
    defaults = system.definition.defaults
    middle = {k: 0.5 * (low + high) for k, (low, high) in ranges.items() if defaults[k] is None}
    values = zip(system.parameter_names, system.parameter_vector(middle).tolist(), strict=True)
    sliders = []
    for name, value in values:
        usual = (min(0.0, 2 * value), max(0.0, 2 * value)) if value else (-1.0, 1.0)
        low, high = ranges.get(name, usual)
        sliders.append(dict(name=name, value=value, low=min(low, value), high=max(high, value)))
    return sliders


def _box(system: FilippovSystem, given: Sequence[float]) -> Array:
    """Ranges of the states, (n, 2)."""
    n = system.dimension
    limits = np.asarray(given, float)
    if limits.size != 2 * n:
        raise OptionError(f"box has {limits.size} numbers. Give low and high of {n} states.")
    pairs = limits.reshape(n, 2).tolist()
    names = system.state_names
    return np.array([_pair(own, f"box of {k}") for k, own in zip(names, pairs, strict=True)])


def _around(
    system: FilippovSystem, x0: Array, t_end: float, parameters: Mapping[str, float]
) -> Array:
    """Ranges of the states around a run, (n, 2)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the run is only measured
        run = simulate(system, x0, t_end, parameters=parameters, max_events=2000, max_steps=20_000)
    x = np.vstack([run.x, run(np.linspace(run.t[0], run.t[-1], 400))])
    x = x[np.isfinite(x).all(axis=1)]
    low, high = x.min(axis=0), x.max(axis=0)
    size = high - low
    gap = _MARGIN * np.where(size > 1e-9 * (1 + np.abs(high)), size, 1 + np.abs(high))
    return np.stack([low - gap, high + gap], axis=1)


def _surfaces(system: FilippovSystem) -> dict[str, Any]:
    """What the page can say of surfaces: it scans a plane, or cuts the surface in space by planes."""
    plain, planar = _is_plain(system), system.dimension == 2
    smooth = not (system.surface_count or system.impacts or system.time_dependent)
    return dict(
        surfaces=list(system.surface_names),
        scan=planar and (plain or (smooth and not system.definition.discrete)),
        slides=plain and bool(system.switching(0).slides),
        cuts=_cuts(system) if plain and system.dimension > 2 else None,
    )


def _held(system: FilippovSystem) -> dict[str, Any]:
    """Values of discrete states; of each clock its state, and its guard counted from the last."""
    d = system.definition
    free: list[list[float] | None] = [None] * (system.dimension - len(d.discrete))
    values = free + [sorted(own) if own else None for own in d.discrete]
    triggers = [d.rules[len(d.stops) + reset].atoms for reset, _ in d.clocks]
    guards = [min(own) - d.guards.numel() for own in triggers]
    return dict(
        values=values, clocks=[[k, guard] for (_, k), guard in zip(d.clocks, guards, strict=True)]
    )


def _is_plain(system: FilippovSystem) -> bool:
    """Whether there is one surface, on which sliding is that of convex combinations of two fields."""
    others = system.sets or system.impacts or system.half_lines or system.joints
    if system.surface_count != 1 or system.time_dependent or others or system.remembering:
        return False
    raised = raised_of(system)
    return bool(raised.affine) and not len(raised.lower[0]) and not system.definition.discrete


def _cuts(system: FilippovSystem) -> list[list[int]]:
    """States of the planes that cut the surface, and last the state that is constant on each; in two directions."""
    gradient = system.gradient(system.surface_function())
    levels = sorted(range(3), key=lambda i: not gradient[i].is_zero())[:2]
    return [[*(i for i in range(3) if i != level), level] for level in levels]
