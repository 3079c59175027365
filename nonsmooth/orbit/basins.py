"""Basins of attraction: where many starts end, told by the attractors that their runs come back to.

Runs are looked at on a section (events, a period, or times), in rounds. Attractors are what a few runs
over the whole time come back to; each start is followed until it stays beside one of them. Starts that
stay beside none in the whole time may show further attractors.

Source: Datseris & Wagemakers 2022 (Chaos 32, 023104), with samples at events instead of time steps and
distances instead of cells.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..flow.ensembles.work import Work, checked_work
from ..flow.options import tolerances
from ..flow.saving import Savable
from ..model import (
    Array,
    FilippovSystem,
    Parameters,
    PointError,
    explain,
    real,
    real_array,
    require_system,
    whole,
)
from .attractors import ACCUMULATION, FAILED, NON_UNIQUE, STOPPED, UNDECIDED, Attractor, Search

_NAMES = {
    UNDECIDED: "undecided or lost",
    NON_UNIQUE: "not unique",
    ACCUMULATION: "events accumulate",
    STOPPED: "stopped",
    FAILED: "failed",
}


@dataclass(frozen=True, eq=False, repr=False)
class Basins(Savable, labels="...", starts="... n nan", axes="*"):
    """Which attractor each start goes to.

    Attributes
    ----------
    labels : ndarray of int32 (...)
        From 1: number of the attractor. 0: undecided in the given time, or lost (far away); -1:
        NON_UNIQUE; -2: ACCUMULATION; -3: STOPPED by a stop of the system; -4: any other status.
    attractors : list of Attractor
        ``attractors[k - 1]`` has the label k.
    starts : ndarray (..., n)
        The starts, in the shape of the grid.
    axes : dict of str to ndarray
        The grid's axes by names of states, if it was given so.
    state_names : tuple of str
        Names of the states, in their order on the last axis.
    complete : bool
        False if the computation was interrupted; what was not decided by then has the label 0.
    """

    labels: NDArray[np.int32]
    attractors: list[Attractor]
    starts: Array
    axes: dict[str, Array] = field(default_factory=dict)
    state_names: tuple[str, ...] = ()
    complete: bool = True

    @property
    def fractions(self) -> dict[int, float]:
        """Part of the starts with each label that occurs."""
        found, number = np.unique(self.labels, return_counts=True)
        parts = (number / self.labels.size).tolist()
        return dict(zip(found.tolist(), parts, strict=True))

    @property
    def errors(self) -> dict[int, float]:
        """Standard errors of ``fractions`` where the starts were drawn at random."""
        size = self.labels.size
        return {k: float(np.sqrt(p * (1 - p) / size)) for k, p in self.fractions.items()}

    def name(self, label: int) -> str:
        """Say what a label means.

        Parameters
        ----------
        label : int
            An entry of ``labels``.

        Returns
        -------
        str
            For example ``"attractor 2"`` or ``"undecided"``.
        """
        return _NAMES.get(label, f"attractor {label}")

    def __repr__(self) -> str:
        parts = ", ".join(f"{self.name(k)} {p:.2%}" for k, p in self.fractions.items())
        cut = "" if self.complete else "; interrupted"
        return (
            f"Basins({self.labels.shape} starts, {len(self.attractors)} attractors: {parts}{cut})"
        )


def basins(
    system: FilippovSystem,
    grid: Mapping[str, ArrayLike] | ArrayLike,
    t_end: float,
    *,
    section: Any = None,
    attractors: Sequence[ArrayLike] = (),
    near: float = 0.01,
    samples: int = 16,
    rounds: int = 16,
    t_start: float = 0.0,
    parameters: Parameters | None = None,
    tol: float = 1e-9,
    rtol: float | None = None,
    atol: float | None = None,
    work: Work | None = None,
) -> Basins:
    """Label starts by the attractors that their runs go to.

    Parameters
    ----------
    system : FilippovSystem
        With scalar multipliers; where it depends on time, periodically.
    grid : mapping or array_like (..., n)
        Starts; or for each state, by name, a number or the values (k,) of an axis.
    t_end : float
        Time in which a run has to come to its attractor. Those that are there earlier end earlier.
    section : Section, str, number or expression, optional
        Where runs are looked at: an event, a surface of your own, a period (needed where the system
        depends on time). Without it they are looked at after equal times.
    attractors : sequence of array_like (n,) or (m, n), optional
        Points of attractors that are known; others are still found.
    near : float, optional
        A run belongs to an attractor whose points it stays beside, to this part of the extent of the
        starts and of what runs from them do. It must be less than the distance from an attractor to the boundary of its basin.
    samples : int, optional
        Looks in each round, all of which must be near.
    rounds : int, optional
        Rounds in which the time is spent; the time of one should be enough for a few returns.
    t_start, parameters, tol, rtol, atol : optional
        As in :func:`simulate`; parameters are numbers.
    work : Work, optional
        Threads or executor, progress bars, and a checkpoint: after an interruption the same call
        goes on from there.

    Returns
    -------
    Basins
        Ctrl-C ends with what was decided.

    Raises
    ------
    DefinitionError
        ``system`` is none, or has vector multipliers.
    OptionError
        A time, a number of samples or rounds or a section out of its range; no period, though the
        system depends on time.
    PointError
        Starts or attractors of a wrong shape, none, or one that is not finite.
    ParameterError
        An unknown parameter, one without a value, or a value that is not a finite number.

    Examples
    --------
    A mass between two springs that pull it to -1 and to 1, with friction:

    >>> import casadi as ca, numpy as np, nonsmooth as ns
    >>> x, v = ca.SX.sym("x"), ca.SX.sym("v")
    >>> well = ns.FilippovSystem(
    ...     [x, v], surface=x, above=[v, 1 - x - 0.3 * v], below=[v, -1 - x - 0.3 * v])
    >>> found = ns.basins(well, {"x": np.linspace(-3, 3, 13), "v": 0.0}, t_end=100.0)
    >>> [a.points[0].round(3).tolist() for a in found.attractors], found.labels.tolist()
    ([[1.0, 0.0], [-1.0, -0.0]], [1, 2, 2, 2, 2, 2, -1, 1, 1, 1, 1, 1, 2])

    At rest on the edge, $x = 0$, both futures are possible: -1 says that.
    """
    require_system(system)
    starts, axes = _starts(system, grid)
    _require_finite(starts)
    search = Search(
        system,
        starts.reshape(-1, system.dimension),
        t_start=real(t_start, "t_start"),
        t_end=real(t_end, "t_end"),
        section=section,
        near=real(near, "near", expected="a number from 0 to 1", low=1e-12, high=1.0),
        samples=whole(samples, "samples"),
        rounds=whole(rounds, "rounds"),
        parameters=parameters,
        tolerances=tolerances(tol, rtol, atol),
        work=checked_work(work),
    )
    for points in _listed(system, attractors):
        search.known(points)
    complete = search.run()
    labels = search.labels.reshape(starts.shape[:-1])
    return Basins(labels, search.found, starts, axes, system.state_names, complete)


def _listed(system: FilippovSystem, attractors: Sequence[ArrayLike]) -> list[Array]:
    """Points (m, n) of attractors that are known."""
    n = system.dimension
    try:
        found = [np.atleast_2d(real_array(points, "attractors")) for points in attractors]
    except TypeError:  # one that is no sequence
        found = [np.zeros((0, 0))]
    for points in found:
        if points.ndim != 2 or points.shape[1] != n or not np.isfinite(points).all():
            raise PointError(
                explain(
                    "attractors",
                    expected=f"points (m, {n}) that are finite, for each attractor",
                    received=repr(attractors),
                    advice="For example attractors=[[0.0, 1.0], [2.0, 0.0]] are two, of a point each.",
                )
            )
    return found


def _require_finite(starts: Array) -> None:
    """Refuse starts (..., n) of which one is no start: no run begins there, so none can fail."""
    rows = starts.reshape(-1, starts.shape[-1])
    wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(rows) and not wrong.size:
        return
    first = f", the first of them {rows[wrong[0]].tolist()}" if wrong.size else ""
    raise PointError(
        explain(
            "grid",
            expected="finite starts, at least one",
            received=f"{wrong.size} of {len(rows)} that are not finite{first}" if first else "none",
            advice="Leave out what is no number; basins of part of a grid take a list (m, n).",
        )
    )


def _starts(
    system: FilippovSystem, grid: Mapping[str, ArrayLike] | ArrayLike
) -> tuple[Array, dict[str, Array]]:
    """Starts (..., n) and the axes by name."""
    names = system.state_names
    if not isinstance(grid, Mapping):
        starts = real_array(grid, "grid")
        if starts.ndim == 0 or starts.shape[-1] != len(names):
            raise PointError(
                explain(
                    "grid",
                    expected=f"shape (..., {len(names)}), or a mapping of the states {list(names)}",
                    received=f"shape {starts.shape}",
                    advice='For example {"x": numpy.linspace(-1, 1, 100), "v": 0.0}.',
                )
            )
        return starts, {}
    given = {str(k): real_array(v, f"grid {k}") for k, v in grid.items()}
    if set(given) != set(names) or any(v.ndim > 1 for v in given.values()):
        raise PointError(
            explain(
                "grid",
                expected=f"a number or an axis (k,) for each of the states {list(names)}",
                received=str({k: v.shape for k, v in given.items()}),
                advice="A state that does not vary has a number.",
            )
        )
    axes = {name: given[name] for name in names if given[name].ndim}
    mesh = np.meshgrid(*axes.values(), indexing="ij") if axes else []
    shape = mesh[0].shape if mesh else ()
    columns = dict(zip(axes, mesh, strict=True))
    whole_grid = [np.broadcast_to(columns.get(n, given[n]), shape) for n in names]
    return np.stack(whole_grid, axis=-1), axes
