"""Regularisation: each multiplier becomes a steep smooth function of its switching function.

lambda_i = phi(h_i / eps) with phi from -1 to +1 (Sotomayor & Teixeira 1996). As eps -> 0 the smooth
system tends to the Filippov system where the latter's solution is unique: attracting sliding becomes
a slow manifold h = eps phi^-1(lambda). Where the Filippov solution is not unique (repelling sliding,
two-folds) the layer decides, differently for each phi and eps.

The functions here have phi'(0) = 1 and approach +-1 without reaching them:

    "tanh"       tanh(s)                  1 - phi ~ 2 exp(-2 s)
    "erf"        erf(sqrt(pi) s / 2)      1 - phi ~ exp(-pi s^2 / 4)
    "algebraic"  s / sqrt(1 + s^2)        1 - phi ~ 1 / (2 s^2)
    "arctan"     (2/pi) arctan(pi s / 2)  1 - phi ~ 4 / (pi^2 s)

Sotomayor and Teixeira take phi = +-1 outside [-1, 1]; that is smooth but not analytic, so it has no
jets there; tanh and erf come closest. The error at crossing and in sliding is O(eps), with arctan
O(eps log(1/eps)). A tail 1 - phi ~ s^-p leaves a visible fold O(eps^(2p/(2p+1))) late, from
h ~ xi^2 and xi ~ (eps/h)^p at the distance xi from it: 2/3 for arctan, 4/5 for algebraic.

A step-size control far from a thin layer would step over it. So each layer has edges, resets that do
not change the state, on which a step must end: one where phi is +-1 to rounding or to usual
tolerances, and nearer ones for coarse tolerances.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from ..checks import real
from ..errors import DefinitionError, OptionError
from ..reading import scalar
from .events import Reset, Stop
from .system import FilippovSystem, require_plain, require_system


@dataclass(frozen=True)
class Transition:
    """A transition function and the arguments at which the layer has edges."""

    phi: Callable[[ca.SX], ca.SX]
    edges: tuple[float, ...] = ()


TRANSITIONS: dict[str, Transition] = {
    "tanh": Transition(ca.tanh, (3.0, 19.0)),
    "erf": Transition(lambda s: ca.erf(math.sqrt(math.pi) / 2 * s), (2.0, 6.8)),
    "algebraic": Transition(lambda s: s / ca.sqrt(1 + s**2), (10.0, 1e3, 1e5)),
    "arctan": Transition(lambda s: 2 / math.pi * ca.atan(math.pi / 2 * s), (40.0, 1e5, 1e9)),
}


def regularise(
    system: FilippovSystem,
    eps: float | None = 1e-3,
    *,
    transition: str | Callable[[ca.SX], ca.SX] = "tanh",
    name: str = "eps",
    edges: bool = True,
) -> FilippovSystem:
    """Smooth a system: each multiplier becomes $phi(h/eps)$.

    Parameters
    ----------
    system : FilippovSystem
        Its parameters, stops and resets are kept. Hidden dynamics are kept too: between -1 and +1
        the field is what it was with the multiplier there.
    eps : float or None, optional
        Width of the layer, in the units of h: default of the parameter ``name``; None for no
        default.
    transition : {"tanh", "erf", "algebraic", "arctan"} or callable, optional
        $phi$, with slope 1 at 0 and limits -1 and +1. A callable takes and returns an SX scalar and
        must be smooth. It has no edges: give ``max_step``, below the time in which the layer is
        passed, or a run can step over it.
    name : str, optional
        Name of the parameter.
    edges : bool, optional
        Whether the layer has edges: resets ``"edge of h0"`` (and ``"edge of h0 2"``, ...) that do not
        change the state, where a step ends so that none passes over the layer.

    Returns
    -------
    FilippovSystem
        Without surfaces; its only mode is ``""``.

    Raises
    ------
    OptionError
        ``eps`` is not positive, or the transition is unknown.
    DefinitionError
        The name is taken.
    NotSmoothError
        A callable that is not smooth.

    Notes
    -----
    Source: Sotomayor & Teixeira 1996, "Regularization of discontinuous vector fields";
    the limit is Filippov's in sliding regions: Llibre, da Silva & Teixeira 2008.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, v, lam = (ca.SX.sym(s) for s in ("x", "v", "lam"))
    >>> relay = ns.FilippovSystem([x, v], field=[v, -x - lam], multipliers=lam, surface=v)
    >>> smooth = ns.regularise(relay, 1e-4, transition="algebraic")
    >>> smooth.surface_count, smooth.parameter_names
    (0, ('eps',))
    >>> run = ns.simulate(smooth, [0.5, 0.0], 1.0)  # sticks: lam = -x, so v = -eps x/sqrt(1 - x^2)
    >>> bool(abs(run.x[-1, 1] + 1e-4 * 0.5 / 0.75**0.5) < 1e-7)
    True
    """
    require_system(system)
    require_plain(system, "regularise")
    if eps is not None:
        eps = real(
            eps,
            "eps",
            expected="a positive number, or None for no default",
            advice="It is the width of the layer in the units of the switching function.",
            low=math.nextafter(0.0, 1.0),
        )
    taken = {*system.parameter_names, *system.state_names}
    if system.time_dependent:
        taken.add(str(system.extended_states[system.dimension]))
    if not isinstance(name, str) or not name or name in taken:
        raise DefinitionError(
            f"name: expected a name that the system does not use, received {name!r}. Choose another "
            "one, such as name='width'."
        )
    chosen = _chosen(transition)
    width = ca.SX.sym(name)
    surfaces = [system.surface_function(i) for i in range(system.surface_count)]
    multipliers = ca.vertcat(*[ca.SX(chosen.phi(h / width)) for h in surfaces])
    d, n, stops = system.definition, system.dimension, system.stops
    frame, guards = d.frame(), ca.vertsplit(d.guards)
    frame["parameters"][width] = eps
    resets = [
        Reset(guards[len(stops) + j], ca.vertsplit(d.maps[:, j]), direction, label)
        for j, (label, direction) in enumerate(system.resets)
    ]
    if edges:
        resets += [edge for s in chosen.edges for edge in _edges(system, surfaces, s * width)]
    return FilippovSystem(
        **frame,
        field=ca.vertsplit(system.field_with(multipliers))[:n],
        stops=[Stop(guards[i], way, label) for i, (label, way) in enumerate(stops)],
        resets=resets,
    )


def _chosen(transition: str | Callable[[ca.SX], ca.SX]) -> Transition:
    if isinstance(transition, str) and transition in TRANSITIONS:
        return TRANSITIONS[transition]
    if callable(transition):
        s = ca.SX.sym("s")
        phi = scalar(transition(s), "transition")
        values = ca.Function("phi", [s], [phi])
        low, high = float(values(-1e12)), float(values(1e12))
        if abs(low + 1.0) < 1e-6 and abs(high - 1.0) < 1e-6:
            return Transition(transition)
        raise OptionError(
            f"transition: it goes from {low:g} to {high:g}, but lambda is -1 far below the surface and "
            "+1 far above it. Give a function with these limits."
        )
    raise OptionError(
        f"transition: expected one of {sorted(TRANSITIONS)} or a function of an SX scalar, "
        f"received {transition!r}. All have slope 1 at 0; 'tanh' reaches +-1 fast, 'arctan' "
        "slowly."
    )


def _edges(system: FilippovSystem, surfaces: list[ca.SX], far: ca.SX) -> list[Reset]:
    """Resets that do not change the state, at the distance ``far`` from each surface."""
    same = ca.vertsplit(system.extended_states)[: system.dimension]
    return [
        Reset(h - side * far, same, 0, f"edge of h{i}")
        for i, h in enumerate(surfaces)
        for side in (1, -1)
    ]
