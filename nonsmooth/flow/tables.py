"""Results as DataFrames of pandas and Datasets of xarray, which are imported on use."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from ..model import OptionError
from .status import Status

if TYPE_CHECKING:
    from .results import Ensemble
    from .trajectory import Trajectory


def library(name: str, what: str, extra: str = "tables") -> Any:
    """Import an optional library."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise OptionError(
            f"{what} needs {name}, which cannot be imported ({error}). Install it with "
            f"python -m pip install 'nonsmooth-dynamics[{extra}]'."
        ) from error


def trajectory_table(run: Trajectory, what: str) -> Any:
    """Points, events or samples of a run as a DataFrame."""
    pandas = library("pandas", "to_pandas")
    names = list(run.system.state_names)
    if what == "points":
        frame = pandas.DataFrame(run.x, columns=names, index=pandas.Index(run.t, name="t"))
    elif what == "samples":
        if run.sample_t is None or run.sample_x is None:
            raise OptionError("to_pandas: the run has no samples. Simulate with t_eval= or at=.")
        index = pandas.Index(run.sample_t, name="t")
        frame = pandas.DataFrame(run.sample_x, columns=names, index=index)
    elif what == "events":
        events, labels = (
            run.events,
            ("kind", "name", "element", "side", "mode_before", "mode_after"),
        )
        frame = pandas.DataFrame({"t": events.t} | {c: events.column(c) for c in labels})
        for suffix, states in (("", events.x), ("_after", events.x_after)):
            for i, name in enumerate(names):
                frame[name + suffix] = states[:, i]
    else:
        raise OptionError(f"to_pandas: what is {what!r}. Give 'points', 'events' or 'samples'.")
    frame.attrs.update(_attributes(run))
    return frame


def _attributes(run: Trajectory) -> dict[str, Any]:
    return {"status": str(run.status), "itinerary": run.itinerary, **run.parameters}


def trajectory_set(run: Trajectory) -> Any:
    """Points of a run, and its samples, as a Dataset."""
    xarray = library("xarray", "to_xarray")
    names = list(run.system.state_names)
    variables: dict[str, Any] = {"x": (("t", "state"), run.x)}
    coordinates: dict[str, Any] = {"t": run.t, "state": names}
    if run.sample_t is not None:
        variables["sample_x"] = (("sample", "state"), run.sample_x)
        coordinates["sample_t"] = ("sample", run.sample_t)
    return xarray.Dataset(variables, coordinates, attrs=_attributes(run))


def ensemble_table(many: Ensemble) -> Any:
    """A row for each trajectory of an ensemble as a DataFrame, in the order of its arrays."""
    pandas = library("pandas", "to_pandas")
    columns: dict[str, Any] = {"t": many.t.ravel()}
    columns |= {name: many.x[..., i].ravel() for i, name in enumerate(_names(many))}
    columns["status"] = pandas.Categorical.from_codes(
        many.status.ravel(), categories=[str(s) for s in Status]
    )
    columns["itinerary"] = many.itinerary.ravel()
    columns |= {f"{kind}_count": number.ravel() for kind, number in many.events.items()}
    index = None
    if many.t.ndim > 1:
        axes = [range(k) for k in many.t.shape]
        index = pandas.MultiIndex.from_product(axes, names=_axes(many))
    return pandas.DataFrame(columns, index=index)


def ensemble_set(many: Ensemble) -> Any:
    """An ensemble as a Dataset with its axes ``start_0``, ``start_1``, ... and ``state``."""
    xarray = library("xarray", "to_xarray")
    axes = _axes(many)
    variables: dict[str, Any] = {
        "x": ((*axes, "state"), many.x),
        "t": (axes, many.t),
        "status": (axes, many.status, {"flag_meanings": " ".join(str(s) for s in Status)}),
        "itinerary": (axes, many.itinerary.astype(str)),
    }
    variables |= {f"{kind}_count": (axes, number) for kind, number in many.events.items()}
    if many.event_x is not None:
        variables["event_x"] = ((*axes, "state"), many.event_x)
        variables["event_t"] = (axes, many.event_t)
    if many.sample_x is not None:
        variables["sample_x"] = ((*axes, "sample", "state"), many.sample_x)
        variables["sample_t"] = ((*axes, "sample"), many.sample_t)
    return xarray.Dataset(variables, {"state": _names(many)})


def _names(many: Ensemble) -> list[str]:
    return list(many.state_names) or [f"x{i}" for i in range(many.x.shape[-1])]


def _axes(many: Ensemble) -> list[str]:
    return [f"start_{k}" for k in range(many.t.ndim)]
