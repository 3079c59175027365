"""Entries of ``surfaces=``: the functions of an element and the name of its law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..errors import DefinitionError
from ..reading import Expression, listed, scalar, symbols

#: Largest codimension of a set: slip has two components, three with drilling.
LARGEST = 3


@dataclass(frozen=True)
class Entry:
    """An element: its law (``flow/constants.py``), its functions, how much lower each is at multiplier -1.

    Also its multiplier, if it brings one, and whether that enters the field nonlinearly.
    """

    law: str
    functions: tuple[ca.SX, ...]
    hysteresis: tuple[ca.SX, ...]
    multiplier: ca.SX | None = None
    hidden: bool = False


class Element:
    """An entry of ``surfaces=`` that is neither an expression nor a vector of them."""

    def entry(self, what: str) -> Entry:
        """Read what was given; ``what`` is its name in messages."""
        raise NotImplementedError


@dataclass(frozen=True)
class Relay(Element):
    """A relay with hysteresis: its multiplier is +1 or -1 and keeps its value between two thresholds.

    Given in place of a switching function in ``surfaces=``. The multiplier becomes +1 where the signal
    rises to ``on`` and -1 where it falls to ``off``; its letters are ``+`` and ``-``. A start between the
    thresholds is off unless ``start_mode`` has ``+``; ``start=`` a run or an event keeps its letter.

    Parameters
    ----------
    signal : expression
        Of states, parameters and time.
    on, off : expressions or numbers
        Thresholds, ``on`` above ``off``; their difference may depend on parameters only.

    Raises
    ------
    DefinitionError
        Thresholds in the wrong order, or whose distance changes along a motion.

    Examples
    --------
    A room that is cooled from 22 degrees down to 18:

    >>> import casadi as ca, nonsmooth as ns
    >>> x, u = ca.SX.sym("x"), ca.SX.sym("u")
    >>> room = ns.FilippovSystem(
    ...     [x], field=[20 - x - 4 * u], surfaces=[ns.Relay(x, on=22, off=18)], multipliers=[u])
    >>> run = ns.simulate(room, [20.0], t_end=4.0)
    >>> run.itinerary, bool(abs(run.events[1].t - run.events[0].t - ca.log(3)) < 1e-9)
    ('- + - + -', True)
    """

    signal: Expression
    on: Expression
    off: Expression

    def entry(self, what: str) -> Entry:
        """Read the signal and the thresholds: h is above the lower one while the relay is on."""
        signal, on = scalar(self.signal, f"signal of {what}"), scalar(self.on, f"on of {what}")
        off = scalar(self.off, f"off of {what}")
        if (width := on - off).is_constant() and not float(width) > 0.0:
            raise DefinitionError(
                f"{what}: on is {on} and off is {off}. Give a relay on= above off=; with equal thresholds "
                "it is a surface."
            )
        return Entry("relay", (signal - off,), (width,))


@dataclass(frozen=True, eq=False)
class Complementarity:
    """A complementarity condition ``0 <= y``, ``multiplier >= 0``, one of them zero: an ideal diode, a projection.

    Given in ``complementarity=``. Its letters are ``o`` (open: the multiplier is 0) and ``c`` (closed: y is 0);
    closing is an event of kind ``contact``, opening one of kind ``release``. A start with y < 0, or a reset to
    one, jumps along the multipliers' directions in the field to y >= 0: an event of kind ``jump``.

    Parameters
    ----------
    y : expression
        Of states, parameters and time, and of the multipliers of complementarity conditions, in which it is
        linear. Its rate contains a multiplier unless y itself does.
    multiplier : SX symbol
        Of the field: the diode's current where y is its reverse voltage, or the other way round.
    name : str, optional
        Shown in events.

    Raises
    ------
    DefinitionError
        A multiplier that enters nonlinearly or nowhere; one that enters only the second derivative of y, which is a
        contact (:class:`Impact`).

    Notes
    -----
    Several conditions are solved together: the matrix of the derivatives of y, or of its rate, by the multipliers may
    be any for which the motion is unique, as those of passive circuits.

    Source: Acary, Bonnefon & Brogliato 2011, Nonsmooth Modeling and Simulation for Switched Circuits; Nagurney & Zhang
    1996, Projected Dynamical Systems; Moreau 1977 for sweeping processes.

    Examples
    --------
    A coil fed through a diode: the current i cannot be negative, and the diode blocks with the voltage u:

    >>> import casadi as ca, nonsmooth as ns
    >>> i, u, t = (ca.SX.sym(s) for s in ("i", "u", "t"))
    >>> diode = ns.Complementarity(i, multiplier=u, name="diode")
    >>> coil = ns.FilippovSystem([i], field=[ca.sin(t) - i + u], complementarity=diode, time=t)
    >>> run = ns.simulate(coil, [0.0], t_end=20.0)
    >>> run.itinerary, round(run.events[0].t, 6)
    ('o c o c o c o', 3.940733)
    """

    y: Expression
    multiplier: Expression
    name: str = "complementarity"

    def entry(self) -> Entry:
        """Read y and the multiplier."""
        lam = symbols([self.multiplier], f"multiplier of {self.name!r}")
        return Entry("complementarity", (scalar(self.y, f"y of {self.name!r}"),), (ca.SX(0),), lam)


def read_entries(surface: Expression | None, surfaces: Sequence[Expression] | None) -> list[Entry]:
    """Surfaces, sets and other elements, in their order."""
    if surface is not None and surfaces is not None:
        raise DefinitionError(
            "surface: expected either surface= or surfaces=, received both. One switching "
            "function goes to surface=, several to surfaces=."
        )
    given = [surface] if surface is not None else listed(surfaces)
    return [_read_entry(v, f"surface {i}") for i, v in enumerate(given)]


def multipliers_of(entries: Sequence[Entry], given: Any) -> list[Any]:
    """Multipliers of all entries: given ones, between those of elements."""
    rest = listed(given)
    if len(rest) == len(entries):
        return rest
    brought = [entry.multiplier for entry in entries]
    missing = sum(own is None for own in brought)
    if len(rest) != missing and any(own is not None for own in brought):
        raise DefinitionError(
            f"multipliers: expected {missing}, for what brings none of its own, received {len(rest)}. A friction "
            "has its own."
        )
    if len(rest) != missing:
        return rest
    following = iter(rest)
    return [next(following) if own is None else own for own in brought]


def unknowns_of(elements: Any) -> ca.SX:
    """Multipliers and reactions of complementarity conditions, impacts or constraints."""
    given = listed(elements) if isinstance(elements, (list, tuple)) else [elements]
    own = [getattr(e, "multiplier", getattr(e, "reaction", None)) for e in given]
    names = [f"unknown of {getattr(e, 'name', e)!r}" for e in given]
    found = [symbols([e], what) for e, what in zip(own, names, strict=True) if e is not None]
    return ca.vertcat(*found) if found else ca.SX(0, 1)


def functions_of(entries: Sequence[Entry]) -> ca.SX:
    """All switching functions."""
    found = [e for entry in entries for e in entry.functions]
    return ca.vertcat(*found) if found else ca.SX(0, 1)


def hysteresis_of(entries: Sequence[Entry]) -> ca.SX:
    """Reduction of each function at multiplier -1; empty where there is none."""
    found = [e for entry in entries for e in entry.hysteresis]
    return ca.SX(0, 1) if all(e.is_zero() for e in found) else ca.vertcat(*found)


def laws_of(entries: Sequence[Entry]) -> tuple[str, ...]:
    """Laws of the entries; nothing where all are surfaces and sets."""
    laws = tuple(entry.law for entry in entries)
    return laws if set(laws) - {"surface", "set"} else ()


def _read_entry(value: Any, what: str) -> Entry:
    """Read a surface (a scalar), a set (a vector of two or three) or another element."""
    if isinstance(value, Element):
        return value.entry(what)
    functions = _read_functions(value, what)
    law = "surface" if len(functions) == 1 else "set"
    return Entry(law, functions, (ca.SX(0),) * len(functions))


def _read_functions(value: Any, what: str) -> tuple[ca.SX, ...]:
    if not isinstance(value, (list, tuple)) and not (
        isinstance(value, (ca.SX, ca.DM)) and ca.SX(value).numel() > 1
    ):
        return (scalar(value, what),)
    entries = listed(value)
    if isinstance(value, (ca.SX, ca.DM)) and 1 not in value.shape:
        raise DefinitionError(
            f"{what}: expected a scalar or a column, received a matrix of shape {value.shape}."
        )
    if not 1 <= len(entries) <= LARGEST:
        raise DefinitionError(
            f"{what}: expected a scalar or a vector of at most {LARGEST} switching functions, "
            f"received {len(entries)} of them. A vector is one set, on which all its components "
            "vanish; give surfaces that do not belong together as separate entries."
        )
    return tuple(scalar(e, f"{what}[{i}]") for i, e in enumerate(entries))
