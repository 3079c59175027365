"""The numbers at a point of a surface: h, the two fields, L1, L2 and their gradients.

Everything in this floor is read from here: L_i = F_i . grad h, L_ij = F_i . grad L_j (so L12 is
F1 . grad L2). Gradients and fields have a time component where the system depends on time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..model import (
    Array,
    DefinitionError,
    FilippovSystem,
    Parameters,
    PointError,
    evaluator,
    explain,
    real,
    require_system,
)

#: Default of ``tol`` for questions about a given point: an angle, and a relative distance.
TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class Numbers:
    """Values at one point of N coordinates (states, then time if the system depends on it).

    Attributes
    ----------
    x : ndarray (N,)
    h : float
        The switching function.
    gradient : ndarray (N,)
        grad h.
    fields : ndarray (2, N)
        F1 (above) and F2 (below).
    lie : ndarray (2,)
        L1 and L2.
    lie_gradients : ndarray (2, N)
        grad L1 and grad L2.
    """

    x: Array
    h: float
    gradient: Array
    fields: Array
    lie: Array
    lie_gradients: Array

    @property
    def second(self) -> dict[str, float]:
        """Second Lie derivatives ``{"L11", "L12", "L21", "L22"}``."""
        values = self.fields @ self.lie_gradients.T
        return {f"L{i + 1}{j + 1}": float(values[i, j]) for i in (0, 1) for j in (0, 1)}

    @property
    def gradients(self) -> Array:
        """Rows grad h, grad L1, grad L2; (3, N)."""
        return np.vstack([self.gradient, self.lie_gradients])

    @property
    def angles(self) -> Array:
        """Sines of the angles of F1 and F2 with the surface, 0 for a vanishing field; (2,)."""
        lengths = np.linalg.norm(self.gradient) * np.linalg.norm(self.fields, axis=1)
        return np.divide(self.lie, lengths, out=np.zeros(2), where=lengths > 0)

    @property
    def distance(self) -> float:
        """Distance to the surface to first order, |h|/|grad h|."""
        length = float(np.linalg.norm(self.gradient))
        if not length:
            return float("inf") if self.h else 0.0
        return abs(self.h) / length


@dataclass(frozen=True, eq=False)
class Place:
    """One surface of a system with its parameters: where questions of this floor are asked.

    Attributes
    ----------
    system : FilippovSystem
    surface : int
    mode : str
        One letter per surface, ``s`` for this one.
    parameters : ndarray
    """

    system: FilippovSystem
    surface: int
    mode: str
    parameters: Array

    def side(self, letter: str) -> str:
        """Return the mode above (``+``) or below (``-``) the surface."""
        return self.mode[: self.surface] + letter + self.mode[self.surface + 1 :]

    def _build(self) -> Sequence[Any]:
        system, sides = self.system, (self.side("+"), self.side("-"))
        lie = [system.lie_derivative([mode], self.surface) for mode in sides]
        h = system.surface_function(self.surface)
        gradients = [system.gradient(e) for e in (h, *lie)]
        return [h, *lie, *gradients, *(system.field(mode) for mode in sides)]

    def at(self, x: Array) -> Numbers:
        """Evaluate at an extended point (N,); entries may be NaN where a field is undefined."""
        evaluate = evaluator(self.system, ("local", self.surface, self.mode), self._build)
        h, l1, l2, *vectors = evaluate.copied(x, self.parameters)
        g, g1, g2, f1, f2 = (v.ravel() for v in vectors)
        lie = np.array([l1[0, 0], l2[0, 0]])
        return Numbers(x, float(h[0, 0]), g, np.array([f1, f2]), lie, np.array([g1, g2]))

    def finite_at(self, x: Array) -> Numbers:
        """Evaluate as ``at`` does and refuse NaN and inf.

        Raises
        ------
        PointError
        """
        numbers = self.at(x)
        if not all(np.all(np.isfinite(v)) for v in (numbers.h, numbers.fields, numbers.gradients)):
            raise PointError(
                explain(
                    f"point {x}",
                    expected="a state where the fields and the derivatives of h, L1 and L2 are "
                    "finite",
                    received=f"h={numbers.h}, F1={numbers.fields[0]}, F2={numbers.fields[1]}, "
                    f"grad L1={numbers.lie_gradients[0]}, grad L2={numbers.lie_gradients[1]}",
                    advice="A root or logarithm left its domain, or a form such as sqrt(x)*x has "
                    "an infinite factor in its derivative: write it as one power.",
                )
            )
        return numbers

    def many(self, x: Array) -> tuple[Array, Array]:
        """Values (k, 3) and gradients (k, 3, N) of (h, L1, L2) at points (k, N)."""
        if not len(x):
            return np.zeros((0, 3)), np.zeros((0, 3, x.shape[1]))
        function = self.system.function(("local", self.surface, self.mode), self._build)
        outputs = function(x.T, self.parameters)
        values = np.vstack([np.array(v) for v in outputs[:3]])
        k, n = x.shape
        gradients = np.stack([np.array(v).reshape(k, n) for v in outputs[3:6]], axis=1)
        return values.T, gradients


def place(
    system: FilippovSystem,
    point: ArrayLike,
    parameters: Parameters | None = None,
    t: float = 0.0,
    surface: int = 0,
    mode: str | None = None,
) -> tuple[Place, Array]:
    """Check the arguments that every function of this floor shares.

    Parameters
    ----------
    system : FilippovSystem
    point : array_like (n,)
    parameters : mapping, optional
    t : float, optional
    surface : int, optional
    mode : str, optional
        One letter per surface; the letter of ``surface`` is replaced by ``s``. By default the
        other surfaces take the signs of their functions at the point.

    Returns
    -------
    where : Place
    x : ndarray (N,)

    Raises
    ------
    PointError, ParameterError, DefinitionError
    """
    require_system(system)
    x = system.extended_point(point, t)
    p = system.parameter_vector(parameters)
    if system.surface_count == 0:
        raise DefinitionError(
            "system: expected at least one switching surface, received a smooth system. Give "
            "surface= with above= and below=, or surfaces= with multipliers=."
        )
    system.surface_function(surface)  # refuses what is no index or out of range
    letters = list(_signs(system, x, p, surface) if mode is None else mode)
    if mode is not None:
        system.parse_mode(mode)
    letters[surface] = "s"
    if letters.count("s") > 1:
        raise DefinitionError(
            explain(
                f"mode {''.join(letters)!r}",
                expected="one sliding surface",
                received=str(letters.count("s")),
                advice="Sliding on an intersection is not built yet: give + or - to the others.",
            )
        )
    return Place(system, int(surface), "".join(letters), p), x


def _signs(system: FilippovSystem, x: Array, p: Array, surface: int) -> str:
    if system.surface_count == 1:
        return "s"

    def build() -> Sequence[Any]:
        return [system.surface_function(i) for i in range(system.surface_count)]

    values = [float(v) for v in system.function(("local", "surfaces"), build).call([x, p])]
    for i, value in enumerate(values):
        if i != surface and value == 0:
            raise PointError(
                explain(
                    f"point {x}",
                    expected=f"a side of surface {i}",
                    received=f"a point on surfaces {surface} and {i}",
                    advice="Choose the side with mode=, one letter per surface.",
                )
            )
    return "".join("+" if value > 0 else "-" for value in values)


def positive(value: float, name: str) -> float:
    """Return a positive finite number or raise OptionError."""
    return real(
        value,
        name,
        expected="a positive finite number",
        advice="Leave it out for the default.",
        low=math.nextafter(0.0, 1.0),
    )


def on_surface(where: Place, x: Array, tol: float) -> Numbers:
    """Evaluate at a point of the surface.

    The point counts as on the surface when its distance is at most ``tol (1 + |x|)``.

    Raises
    ------
    PointError
        Off the surface, or grad h = 0, or not finite.
    """
    numbers = where.finite_at(x)
    if not np.any(numbers.gradient):
        raise PointError(
            explain(
                f"point {x}",
                expected=f"a regular point of surface {where.surface}",
                received="grad h = 0",
                advice="The zero set of h is not a surface there; write h with a nonzero gradient.",
            )
        )
    if numbers.distance > tol * (1 + np.linalg.norm(x)):
        foot = x - numbers.h * numbers.gradient / (numbers.gradient @ numbers.gradient)
        raise PointError(
            explain(
                f"point {x}",
                expected=f"a point on surface {where.surface}, h = 0",
                received=f"h = {numbers.h:.6g} (about {numbers.distance:.3g} away)",
                advice=f"The nearest point of the surface is about {foot.tolist()} (one Newton "
                "step along grad h; repeat it where the surface is curved), or raise tol.",
            )
        )
    return numbers
