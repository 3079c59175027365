"""Immutable objects with named, checked parameters: the base of contact models and laws."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nonsmooth as ns

from .errors import ModelError, UnknownNameError

#: Checks of limits by their text, which ``limits`` and messages use.
LIMITS: dict[str, Callable[[float], bool]] = {
    "> 0": lambda v: v > 0,
    ">= 0": lambda v: v >= 0,
    "in (0, 1]": lambda v: 0 < v <= 1,
    "in [0, 1]": lambda v: 0 <= v <= 1,
    "in (-pi/2, pi/2)": lambda v: -math.pi / 2 < v < math.pi / 2,
}


def number(value: Any, what: str, error: type[Exception] = ns.ParameterError) -> float:
    """Return a scalar as a finite float, or raise."""
    try:
        result = math.nan if isinstance(value, (str, bytes, bool)) else float(value)
    except (TypeError, ValueError, NotImplementedError):
        result = math.nan
    if not math.isfinite(result):
        kind = f" ({type(value).__name__})" if not isinstance(value, float) else ""
        raise error(f"{what}: expected a finite number, received {value!r}{kind}.")
    return result


def numbers(
    value: ArrayLike, what: str, error: type[Exception] = ns.ParameterError
) -> NDArray[np.float64]:
    """Return numbers, finite or not, as an array, or raise."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError) as cause:
        raise error(f"{what}: expected numbers, received {value!r}.") from cause


def require_positive(**options: Any) -> None:
    """Raise an ``OptionError`` for options that are not positive numbers."""
    for name, value in options.items():
        if not number(value, name, ns.OptionError) > 0:
            raise ns.OptionError(f"{name}: expected a positive number, received {value!r}.")


class Parametrised:
    """An immutable object with named numbers, compared and hashed by value.

    Subclasses declare

    - ``parameters``: name -> default (None: the user must give it);
    - ``limits``: name -> one of the keys of ``LIMITS``.

    Both are merged with those of the base classes. Arguments are keywords.
    """

    parameters: ClassVar[Mapping[str, float | None]] = {}
    limits: ClassVar[Mapping[str, str]] = {}

    def __init__(self, **values: float):
        self._set("values", self._checked(self.declared(), values))

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        # help() and editors show each parameter by name instead of **values.
        kind = inspect.Parameter
        shown = list(inspect.signature(cls.__init__).parameters.values())[1:]
        named = [p for p in shown if p.kind is not kind.VAR_KEYWORD]
        taken = {p.name for p in named}
        _check_declarations(cls, taken)
        for name, default in cls.declared().items():
            empty = kind.empty if default is None else default
            if name not in taken and name.isidentifier():
                named.append(kind(name, kind.KEYWORD_ONLY, default=empty))
        cls.__signature__ = inspect.Signature(named)  # type: ignore[attr-defined]

    @classmethod
    def declared(cls) -> dict[str, float | None]:
        """Every parameter with its default, the class's own first."""
        return _merged(cls, "parameters")

    @classmethod
    def declared_limits(cls) -> dict[str, str]:
        """Every limit, the class's own first."""
        return _merged(cls, "limits")

    def limits_of_values(self) -> dict[str, str]:
        """Every limit of its values."""
        return self.declared_limits()

    def _checked(
        self, declared: Mapping[str, float | None], values: Mapping[str, float]
    ) -> dict[str, float]:
        who = type(self).__name__
        unknown = [name for name in values if name not in declared]
        if unknown:
            raise ns.ParameterError(
                f"{who}: expected parameters among {list(declared)}, received {unknown}. Correct the "
                "name, or declare it in `parameters` of the class."
            )
        merged = {**declared, **values}
        missing = [name for name, value in merged.items() if value is None]
        if missing:
            raise ns.ParameterError(
                f"{who}: expected a value for {missing}, received none. They have no default: "
                f"{who}({', '.join(f'{m}=...' for m in missing)})."
            )
        limits = self.limits_of_values()
        result = {name: number(value, f"{who}: {name}") for name, value in merged.items()}
        for name, value in result.items():
            limit = limits.get(name)
            if limit is not None and not LIMITS[limit](value):
                raise ns.ParameterError(
                    f"{who}: {name}: expected a number {limit}, received {value!r}. "
                    "It is physically impossible otherwise."
                )
        return result

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(
            f"{type(self).__name__} is immutable: use model.replace({name}=...) for a changed copy."
        )

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable.")

    def _structure(self) -> tuple[Any, ...]:
        """Further properties, besides the values, by which two of these differ (hashable)."""
        return ()

    def options(self) -> dict[str, Any]:
        """Arguments of the constructor besides the parameters."""
        return {}

    def replace(self, **changes: Any) -> Self:
        """Return a copy with other parameters or options.

        Examples
        --------
        >>> import bounce
        >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
        >>> turf.replace(mu=0.4)
        KelvinVoigt(mu=0.4, d1=0.1, d2=0.1, eta=0.5)
        """
        return type(self)(**{**self.options(), **self.values, **changes})

    values: dict[str, float]

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in vars(self).items() if not k.startswith("_cached")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            self._set(name, value)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Parametrised) or type(self) is not type(other):
            return NotImplemented
        return self.values == other.values and self._structure() == other._structure()

    def __hash__(self) -> int:
        return hash((type(self), tuple(self.values.items()), self._structure()))

    def __repr__(self) -> str:
        declared = self.declared()
        shown = [f"{k}={v:.6g}" for k, v in self.values.items() if v != declared.get(k)]
        shown += [f"{k}={v!r}" for k, v in self.options().items()]
        return f"{type(self).__name__}({', '.join(shown)})"


def _check_declarations(cls: type, options: set[str]) -> None:
    for attribute in ("parameters", "limits"):
        given = vars(cls).get(attribute, {})
        if not isinstance(given, Mapping):
            raise ModelError(
                f"{cls.__name__}: {attribute}: expected a dict, received {given!r}. Write "
                f"{attribute} = dict(name=value)."
            )
    for name, limit in vars(cls).get("limits", {}).items():
        if limit not in LIMITS:
            raise ModelError(
                f"{cls.__name__}: limits: {name}: expected one of {list(LIMITS)}, received {limit!r}."
            )
    taken = sorted(options & set(vars(cls).get("parameters", {})))
    if taken:
        raise ModelError(
            f"{cls.__name__}: parameters: expected names other than the constructor's options, "
            f"received {taken}. No value could be given for them: rename them."
        )


def _merged(cls: type, attribute: str) -> dict[str, Any]:
    """A class's mapping with those of its bases; the most derived class wins."""
    result: dict[str, Any] = {}
    for c in cls.__mro__:
        for name, value in dict(vars(c).get(attribute, {})).items():
            result.setdefault(name, value)
    return result


class Names:
    """Symbols by attribute: ``s.xdot``, ``p.mu``; the error for an unknown name lists the known ones."""

    def __init__(self, kind: str, symbols: Mapping[str, Any]):
        self.__dict__["_kind"] = kind
        self.__dict__["_symbols"] = dict(symbols)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        try:
            return self._symbols[name]
        except KeyError:
            raise UnknownNameError(
                f"{self._kind} {name!r}: expected one of {list(self._symbols)}, received {name!r}. "
                "Parameters are declared in `parameters`, further states in `extra_states`."
            ) from None

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{self._kind} {name!r} is a symbol of the equations; it is not set.")

    def __dir__(self) -> list[str]:
        return list(self._symbols)
