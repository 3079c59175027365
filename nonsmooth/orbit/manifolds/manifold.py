"""Stable and unstable manifolds of saddles and pseudo-saddles, orbits through folds, dividing surfaces."""

from __future__ import annotations

from typing import Any, overload

import numpy as np

from ...flow.ensembles.progress import progress_bar
from ...local import Equilibrium, Fold, FoldFold, PseudoEquilibrium
from ...local.searches.find_two_fold import TwoFold
from ...model import (
    FilippovSystem,
    OptionError,
    Parameters,
    explain,
    real,
    require_system,
    reversed_system,
    whole,
)
from ..periodic.orbit import PeriodicOrbit
from .arcs import Follower
from .dividing import DividingCurves, dividing_curves, plane_of
from .dividing_passages import read_begin, require_event
from .manifold_growth import Grower, Manifold

#: A length that is positive.
_LEAST = float(np.finfo(float).tiny)

Point = Equilibrium | PseudoEquilibrium | Fold | FoldFold | TwoFold | PeriodicOrbit


@overload
def manifold(
    system: FilippovSystem,
    of: Point,
    *,
    stable: bool = True,
    length: float,
    spacing: float | None = None,
    parameters: Parameters | None = None,
    tol: float | None = None,
    max_orbits: int = 400,
    progress: bool = False,
) -> Manifold: ...


@overload
def manifold(
    system: FilippovSystem,
    of: TwoFold,
    *,
    starts: Any,
    box: Any,
    duration: float,
    until: str | None = None,
    begin: Any = None,
    stable: bool = True,
    spacing: float | None = None,
    parameters: Parameters | None = None,
    tol: float | None = None,
    progress: bool = False,
) -> DividingCurves: ...


def manifold(
    system: FilippovSystem,
    of: Point,
    *,
    stable: bool = True,
    length: float | None = None,
    starts: Any = None,
    box: Any = None,
    duration: float | None = None,
    until: str | None = None,
    begin: Any = None,
    spacing: float | None = None,
    parameters: Parameters | None = None,
    tol: float | None = None,
    max_orbits: int = 400,
    progress: bool = False,
) -> Manifold | DividingCurves:
    """Follow the stable or unstable manifold of a point through switches, or cut it by a plane of starts.

    Parameters
    ----------
    system : FilippovSystem
        Without explicit time. A stable manifold is followed backward: without resets and impacts.
    of : Equilibrium, PseudoEquilibrium, Fold, FoldFold, TwoFold or PeriodicOrbit
        From ``find_equilibrium``, ``find_pseudo_equilibrium``, ``fold``, ``fold_fold``,
        ``find_two_fold``, ``periodic_orbit``. Of a visible fold in the plane: the orbits that come to
        it, or leave it. Of a two-fold of three states: the orbits that come to its one canard, the
        dividing surface of those that pass it on either side (or those that leave the canard). Of a
        periodic orbit of three states: the surface of one multiplier inside the unit circle, or one
        outside.
    stable : bool, optional
        Whether orbits that come to the point are asked for (True) or those that leave it.
    length : float
        Of the orbits on it. Not with ``starts``.
    starts : array_like (3, n), callable or orbit.ComputedStarts, optional
        Of a two-fold of n states: a plane of starts, as a point and two directions, or as a function of
        two coordinates that returns n expressions. The dividing surface is cut by it. With ``until``
        also starts that are computed, with times of their own.
    box : array_like (2, 2)
        With ``starts``: the range of either coordinate.
    duration : float
        With ``starts``: how long orbits are looked at. By then they are to have left the two-folds
        to one side of the switching surface or the other. With ``until`` the longest duration of a leg.
    until : str, optional
        With ``starts``: the name of a stop at which orbits end, and both fields have the same component
        across the surface, as a contact has that opens: with the load its friction vanishes. Then ``of``
        is a two-fold there, and what is divided are ends on either side of the surface.
    begin : sequence of (str, (float, float)), optional
        With ``starts``: points of one curve, each with its itinerary, that is followed from the last of
        them on, up to the box, until it ends, or comes back to the first. Otherwise curves are looked for
        in all of the box.
    spacing : float, optional
        Of points along orbits and between them; a hundredth of the length unless given. With ``starts``
        the largest distance of points on bent curves, relative to half of the box or to the scale of
        computed starts; 0.05 unless given.
    parameters : optional
        As in :func:`simulate`.
    tol : float, optional
        As in :func:`simulate`; 1e-10, and with ``starts`` 1e-13, unless given.
    max_orbits : int, optional
        Of a surface.
    progress : bool, optional
        Show on a terminal how many orbits were followed.

    Returns
    -------
    Manifold
        Curves where the manifold has one dimension, a surface where it has two. Backward it ends
        where it meets sliding: what arrives there comes from a whole neighbourhood. Ctrl-C ends it
        with the orbits that it has (``complete`` is false then).
    DividingCurves
        With ``starts``: curves in the plane that divide orbits, made of arcs that slide into a two-fold
        and arcs that just touch the surface, their junctions, and why they end.

    Raises
    ------
    DegenerateError
        No such manifold, or one of more than two dimensions; with ``starts`` a two-fold that parts no
        orbits, or none of the box, or a system with resets, impacts or several surfaces.
    OptionError
        ``of`` is none of these points; explicit time; a length, spacing or number that is not positive.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.
    DefinitionError
        ``system`` is none, or does not have the point's modes; hidden dynamics, vector multipliers.

    Notes
    -----
    Orbits come to attracting sliding in finite time, so the stable manifold of a pseudo-saddle has
    the orbits of both fields that end on it, exactly: they start at the point itself. Other manifolds
    start at a distance of a millionth of ``length`` along eigenvectors.

    In n states two-folds fill a set of dimension n - 3, and the orbits that slide into it a surface of
    dimension n - 1. A plane of starts meets it in curves. On either side orbits slide close to a two-fold
    and leave it to different sides. A curve goes on where orbits no longer slide but touch the surface at a
    visible fold beyond the two-folds: to one side they miss it, to the other they cross it.

    Examples
    --------
    The orbits that end at a pseudo-saddle of the plane divide what slides to the left and right:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> system = ns.FilippovSystem([x, y], surface=y, above=[x + y, -1], below=[x, 1])
    >>> saddle = ns.find_pseudo_equilibrium(system, [0.1, 0.0])
    >>> found = ns.manifold(system, saddle, length=2.0)
    >>> found.dimension, [arc.itinerary for arc in found.arcs], found.arcs[0].points[0].round(9) + 0.0
    (1, ['+', '-'], array([0., 0.]))

    Starts at the height 0.3 that pass a visible two-fold of three states on either side:

    >>> x, y, z = (ca.SX.sym(name) for name in "xyz")
    >>> system = ns.FilippovSystem([x, y, z], surface=x, above=[y, 1, 0.5], below=[z, 0.3, -1])
    >>> fold = ns.find_two_fold(system, near=[0.0, 0.0, 0.0])
    >>> found = ns.manifold(system, fold, starts=lambda a, b: [0.3, a, b], box=[(-2, -0.5), (-1, 1)],
    ...                     duration=6.0)
    >>> [arc.itinerary for arc in found.arcs], found.junctions.round(9)
    (['+', '+ s'], array([[-0.77459667, -0.38729833]]))
    """
    require_system(system)
    if system.time_dependent:
        raise OptionError(
            f"system: expected one without explicit time, received {system!r}. Its saddles move."
        )
    known = (Equilibrium, PseudoEquilibrium, Fold, FoldFold, TwoFold, PeriodicOrbit)
    if not isinstance(of, known):
        raise OptionError(
            explain(
                "of",
                expected="an Equilibrium, a PseudoEquilibrium, a Fold, a FoldFold, a TwoFold or a "
                "PeriodicOrbit",
                received=f"{of!r}",
                advice="Find it with find_equilibrium, find_pseudo_equilibrium, find_two_fold, fold or "
                "periodic_orbit.",
            )
        )
    if spacing is not None:
        spacing = real(spacing, "spacing", expected="a positive number", low=_LEAST)
    given = of.parameters | dict(parameters or {}) if isinstance(of, PeriodicOrbit) else parameters
    p = dict(zip(system.parameter_names, system.parameter_vector(given).tolist(), strict=True))
    if starts is not None:
        end = (duration, until, begin)
        return _cut(system, of, stable, starts, box, end, spacing or 0.05, p, tol, progress)
    if until is not None or begin is not None:
        raise OptionError(
            "until, begin: expected with starts=, a plane of starts, received without."
        )
    long = real(length, "length", expected="a positive number", low=_LEAST)
    follower = Follower(system, p, not stable, long, spacing or long / 100, tol or 1e-10)
    most, bar = whole(max_orbits, "max_orbits"), progress_bar(None, progress, "orbit")
    try:
        return Grower(follower, of, stable, most, bar.update).grow()
    finally:
        bar.close()


def _cut(
    system: FilippovSystem,
    of: Point,
    stable: bool,
    starts: Any,
    box: Any,
    end: tuple[float | None, str | None, Any],
    step: float,
    parameters: dict[str, float],
    tol: float | None,
    progress: bool,
) -> DividingCurves:
    """The dividing surface of a two-fold, cut by a plane of starts."""
    if not isinstance(of, TwoFold):
        raise OptionError(
            f"of: expected a TwoFold with starts=, received {of!r}. Find one with find_two_fold, or "
            "leave starts out."
        )
    duration, until, begin = end
    plane = plane_of(system, starts, box)
    if not plane.exact and until is None:
        raise OptionError(
            "starts: expected with until= where they are computed, received without. Give expressions."
        )
    if until is not None:
        require_event(system, until, of, parameters)
        if not stable:
            raise OptionError(
                "stable: expected True with until=, received False. Stops are not met backward in time."
            )
    span = real(duration, "duration", expected="a positive number", low=_LEAST)
    bar = progress_bar(None, progress, "arc")
    try:
        return dividing_curves(
            system if stable else reversed_system(system),
            of,
            plane,
            stable=stable,
            duration=span,
            step=step,
            until=until,
            begin=read_begin(system, begin),
            parameters=parameters,
            tol=tol or 1e-13,
            report=bar.update,
        )
    finally:
        bar.close()
