"""Definitions in CasADi's MX symbols, as the same in SX symbols."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ..errors import DefinitionError

#: Entries of a DAE dictionary that are read; others must be empty.
_OF_DAE = ("x", "t", "p", "ode")


def in_scalar_symbols(given: dict[str, Any]) -> dict[str, Any]:
    """The arguments of a definition with SX in place of MX, where there is any."""
    if not any(True for value in given.values() for _ in _matrices(value)):
        return given
    symbols = {
        str(s): s for value in given.values() for e in _matrices(value) for s in ca.symvar(e)
    }
    scalars = _Scalars(symbols)
    return {name: scalars.of(value, name) for name, value in given.items()}


def _matrices(value: Any) -> Iterator[ca.MX]:
    """MX expressions in an argument."""
    if isinstance(value, ca.MX):
        yield value
    elif isinstance(value, Mapping):
        for pair in value.items():
            yield from _matrices(pair)
    elif isinstance(value, (list, tuple)):
        for one in value:
            yield from _matrices(one)
    elif is_dataclass(value) and not isinstance(value, type):
        yield from _matrices([getattr(value, f.name) for f in fields(value) if f.init])


class _Scalars:
    """SX expressions of MX ones, over symbols of the same names."""

    def __init__(self, symbols: dict[str, ca.MX]):
        self._from = list(symbols.values())
        self._to = [_named(name, symbol) for name, symbol in symbols.items()]

    def of(self, value: Any, what: str) -> Any:
        """An argument with SX in place of MX; vectors of states and parameters are lists."""
        if isinstance(value, ca.MX):
            entries = ca.vertsplit(ca.vec(self._expanded(value, what)))
            return entries[0] if len(entries) == 1 else entries
        if isinstance(value, Mapping):
            return {k: v for pair in value.items() for k, v in self._pairs(*pair, what)}
        if isinstance(value, (list, tuple)):
            return [one for v in value for one in _flat(self.of(v, what), isinstance(v, ca.MX))]
        if (
            is_dataclass(value)
            and not isinstance(value, type)
            and any(True for _ in _matrices(value))
        ):
            own = {f.name: getattr(value, f.name) for f in fields(value) if f.init}
            return replace(value, **{name: self.of(v, what) for name, v in own.items()})
        return value

    def _pairs(self, key: Any, value: Any, what: str) -> Iterator[tuple[Any, Any]]:
        """One pair of a mapping, or one for each entry of a vector."""
        keys, value = self.of(key, what), self.of(value, what)
        if not isinstance(keys, list):
            yield keys, value
            return
        values = (
            value if np.size(value) > 1 and not isinstance(value, ca.SX) else [value] * len(keys)
        )
        yield from zip(keys, values, strict=True)

    def _expanded(self, e: ca.MX, what: str) -> ca.SX:
        try:
            return ca.SX(ca.Function("e", self._from, [e]).expand()(*self._to))
        except (RuntimeError, NotImplementedError):
            names = ", ".join(
                sorted({f.class_name() for f in ca.Function("e", self._from, [e]).find_functions()})
            )
            raise DefinitionError(
                f"{what}: the MX expression {e} is no graph of scalar operations, as it calls {names or 'others'}. "
                "A table (casadi.interpolant) is nonsmooth.table(x, xs, ys) of SX symbols."
            ) from None


def _named(name: str, symbol: ca.MX) -> ca.SX:
    """An SX symbol, or a vector of them, named as an MX symbol."""
    count = symbol.numel()
    own = [ca.SX.sym(name)] if count == 1 else [ca.SX.sym(f"{name}_{i}") for i in range(count)]
    return ca.reshape(ca.vertcat(*own), symbol.shape)


def _flat(value: Any, matrix: bool) -> list[Any]:
    return value if matrix and isinstance(value, list) else [value]


def read_dae(dae: Any, parameters: Any, events: Mapping[str, Any]) -> dict[str, Any]:
    """States, right-hand side, time and parameters of CasADi's dictionary of a DAE, with events in its symbols."""
    if not isinstance(dae, Mapping) or not {"x", "ode"} <= set(dae):
        raise DefinitionError(
            f"dae: expected a mapping with 'x' and 'ode', and 't' and 'p' where there are any, received {dae!r}."
        )
    further = [
        k
        for k, v in dae.items()
        if k not in _OF_DAE and not (hasattr(v, "numel") and not v.numel())
    ]
    if further:
        raise DefinitionError(
            f"dae: it has the entries {further}, but only 'x', 't', 'p' and 'ode' are read. Algebraic equations with "
            "one solution are solved for z in advance; joints are constraints=, ideal diodes complementarity=."
        )
    given = in_scalar_symbols({**{name: dae.get(name) for name in _OF_DAE}, **events})
    symbols = _entries(given["p"])
    if not isinstance(parameters, Mapping | None):
        raise DefinitionError(
            f"parameters: expected a mapping from names to values, received {parameters!r}. "
            f"The names are {[str(s) for s in symbols]}."
        )
    values = {str(k): v for k, v in dict(parameters or {}).items()}
    unknown = sorted(set(values) - {str(s) for s in symbols})
    if unknown:
        raise DefinitionError(
            f"parameters: {unknown} are no parameters of the DAE, which are {[str(s) for s in symbols]}."
        )
    return {
        "states": _entries(given["x"]),
        "rhs": _entries(given["ode"]),
        "time": given["t"],
        "parameters": {s: values.get(str(s)) for s in symbols},
        **{name: given[name] for name in events},
    }


def _entries(value: Any) -> list[ca.SX]:
    """Scalars of a vector, or of a list of them."""
    if value is None:
        return []
    parts = value if isinstance(value, (list, tuple)) else [value]
    return [e for part in parts for e in ca.vertsplit(ca.vec(ca.densify(ca.SX(part))))]
