"""What is continued: N - 1 smooth equations in N unknowns, and a point of the curve they define.

Lengths and angles are measured in unknowns divided by their ``scale``. A guess is corrected in the
hyperplane across a direction (pseudo-arclength; Keller 1977), so turning points are regular points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...model import Array, DefinitionError, NonsmoothError, explain, is_real
from ..newton import Secant, converge

if TYPE_CHECKING:
    from .zeros import Zero


def read_tests(found: Any) -> dict[str, float]:
    """What ``Curve.tests`` returned, as numbers by name; they may have poles."""
    if type(found) is dict and all(type(k) is str and type(v) is float for k, v in found.items()):
        return found
    if isinstance(found, Mapping):
        number = lambda v: is_real(v) or isinstance(v, (float, np.floating))
        wrong = [k for k, v in found.items() if not (isinstance(k, str) and number(v))]
        if not wrong:
            return {k: float(v) for k, v in found.items()}
        received = f"{found[wrong[0]]!r} under the name {wrong[0]!r}"
    else:
        received = repr(found)
    raise DefinitionError(
        explain(
            "curve.tests",
            expected="a mapping of names to numbers",
            received=received,
            advice='For example return {"half": float(point.u[0]) - 0.5}.',
        )
    )


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a curve.

    Attributes
    ----------
    u : ndarray (N,)
        The unknowns.
    tangent : ndarray (N,)
        Direction of the curve in scaled unknowns, of length 1.
    arclength : float
        From the start of the arc, in scaled unknowns.
    jacobian : ndarray (N - 1, N)
        Of the equations by scaled unknowns; empty for a curve without derivatives.
    tests : mapping of str to float
        Functions whose zeros are looked for.
    """

    u: Array
    tangent: Array
    arclength: float = 0.0
    jacobian: Array = field(default_factory=lambda: np.zeros((0, 0)))
    tests: Mapping[str, float] = field(default_factory=dict)


class Curve:
    """A curve in $R^N$; subclasses say by which equations, and what to watch along it.

    Attributes
    ----------
    scale : ndarray (N,) or float
        Sizes of the unknowns.
    tol : float
        Error of a point, in scaled unknowns.
    exact : bool
        Whether ``equations`` gives the derivative itself, not a :class:`~nonsmooth.continuation.Secant`
        estimate of it; then tangents come from it, otherwise from the chord.
    parameter : int or None
        The unknown whose turning points are looked for, under the name ``"fold"``.
    branching : bool
        Whether branch points are looked for, under the name ``"branch point"``.
    snaps : bool
        Whether the end is solved for (``snap``) also where corrections fail, as they do for equations
        that are not defined beyond it; without derivatives always.

    Examples
    --------
    The unit circle, from its rightmost point once round:

    >>> import nonsmooth as ns
    >>> class Circle(ns.continuation.Curve):
    ...     parameter = 0
    ...     def equations(self, u):
    ...         return np.array([u @ u - 1]), 2 * u[None, :]
    >>> arc = ns.continuation.trace(Circle(), [np.array([1.0, 0.0])], np.array([0.0, 1.0]), step=0.2)
    >>> arc.end, [(zero.name, zero.point.u[0].round(12).tolist()) for zero in arc.zeros]
    ('closed', [('fold', -1.0), ('fold', 1.0)])
    """

    scale: Any = 1.0
    tol: float = 1e-13
    exact: bool = True
    parameter: int | None = None
    branching: bool = False
    snaps: bool = False

    def equations(self, u: Array) -> tuple[Array, Array]:
        """Return the values of the equations and their Jacobian; what a subclass must give.

        Parameters
        ----------
        u : ndarray (N,)
            The unknowns.

        Returns
        -------
        values, jacobian : ndarray (N - 1,), (N - 1, N)
            Zero on the curve, and the derivatives by the unknowns.
        """
        raise NotImplementedError

    def values(self, u: Array) -> Array | None:
        """Return the values of the equations alone, where that is cheaper; else None.

        Parameters
        ----------
        u : ndarray (N,)
            The unknowns.
        """
        return None

    def fault(self, u: Array) -> str:
        """Say why a zero of the equations is not a point of the curve; empty if it is one.

        Parameters
        ----------
        u : ndarray (N,)
            The unknowns.
        """
        return ""

    def tests(self, point: Point) -> Mapping[str, float]:
        """Return the functions whose zeros along the curve are located.

        Parameters
        ----------
        point : Point
            A point of the curve.

        Returns
        -------
        mapping of str to float
            Their values by name. Anything else is refused (DefinitionError).
        """
        return {}

    def ends(self, name: str) -> bool:
        """Whether the curve ends at a zero of a test.

        Parameters
        ----------
        name : str
            Of the test.
        """
        return False

    def ends_at(self, zero: Zero) -> bool:
        """Whether the curve ends at a located zero.

        Parameters
        ----------
        zero : Zero
            Of one of the tests, located on the curve.
        """
        return self.ends(zero.name)

    def passed(self, last: Point, new: Point, ending: Zero | None) -> bool:
        """Whether a step hides something that ends the curve; then shorter ones are taken.

        Parameters
        ----------
        last, new : Point
            The ends of the step.
        ending : Zero or None
            The first zero in the step of a test that ends the curve.
        """
        return False

    def singular(self, name: str) -> bool:
        """Whether the equations are singular at a zero of a test, so that it is interpolated.

        Parameters
        ----------
        name : str
            Of the test.
        """
        return name == "branch point"

    def renewed(self, point: Point) -> Point | None:
        """Return the same point of better equations, e.g. on a new section; None to keep these.

        Parameters
        ----------
        point : Point
            The newest point.
        """
        return None

    def out(self, u: Array) -> str:
        """Say why the curve need not be followed beyond a point; empty if it is followed.

        Parameters
        ----------
        u : ndarray (N,)
            The unknowns.
        """
        return ""

    def snap(self, u: Array, tangent: Array, reach: float) -> Array | None:
        """Solve for the end of the curve, where it is known what ends it; None if it is not near.

        Parameters
        ----------
        u, tangent : ndarray (N,)
            The newest point, and the way ahead in scaled unknowns.
        reach : float
            How far ahead to look.
        """
        return None

    # what follows from the equations ------------------------------------------------------------

    def scaled(self, u: Array) -> tuple[Array, Array]:
        """Return values and Jacobian by scaled unknowns.

        Parameters
        ----------
        u : ndarray (N,)
            Scaled unknowns.

        Returns
        -------
        values, jacobian : ndarray (N - 1,), (N - 1, N)
            As of :meth:`equations`.
        """
        values, jacobian = self.equations(u * self.scale)
        return values, jacobian * self.scale

    def correct(self, guess: Array, across: Array, *, max_iterations: int = 10) -> Array | None:
        """Point of the curve in the hyperplane through ``guess`` across a direction, or None.

        Parameters
        ----------
        guess : ndarray (N,)
            A point near the curve.
        across : ndarray (N,)
            In scaled unknowns; a unit vector keeps that unknown at its value in ``guess``.
        max_iterations : int, optional
            Newton's method gives up after this many.
        """
        start = guess / self.scale
        level = float(across @ start)

        def bordered(v: Array) -> tuple[Array, Array]:
            values, jacobian = self.scaled(v)
            return np.append(values, across @ v - level), np.vstack([jacobian, across])

        def plain(v: Array) -> Array | None:
            values = self.values(v * self.scale)
            return None if values is None else np.append(values, across @ v - level)

        def attempt() -> Array | None:
            # exact derivatives converge quadratically: near a branch point rounding is magnified
            noise = 1e-8 if self.exact else 1e-11
            return converge(
                bordered,
                start,
                tol=self.tol,
                max_iterations=max_iterations,
                linear=self.solve,
                noise=noise,
                values=plain,
            )

        try:
            found = attempt()
            source = getattr(self, "secant", None)
            if found is None and isinstance(source, Secant) and source.forget():
                found = attempt()
        except NonsmoothError:
            return None
        return None if found is None else found * self.scale

    def point(self, u: Array, before: Array, chord: Array, arclength: float) -> Point | None:
        """Describe a zero of the equations: its tangent and its tests; None if that fails.

        Parameters
        ----------
        u : ndarray (N,)
            The zero.
        before : ndarray (N,)
            The tangent before, along which the new one points.
        chord : ndarray (N,)
            The direction from the last point, which stands for the tangent without derivatives.
        arclength : float
            From the start of the arc, in scaled unknowns.
        """
        if not self.exact:
            plain = Point(u, chord, arclength)
            return Point(u, chord, arclength, tests=read_tests(self.tests(plain)))
        try:
            jacobian = self.equations(u)[1] * self.scale
            tangent, sign = self.along(jacobian, before)
            tests: dict[str, float] = {}
            if self.parameter is not None:
                tests["fold"] = float(tangent[self.parameter])
            if self.branching:
                tests["branch point"] = sign
            own = self.tests(Point(u, tangent, arclength, jacobian))
        except (NonsmoothError, np.linalg.LinAlgError):
            return None
        tests.update(read_tests(own))
        return Point(u, tangent, arclength, jacobian, tests)

    def solve(self, matrix: Array, right: Array) -> Array:
        """Solve the linear equations of a corrector; a subclass may know their structure.

        Parameters
        ----------
        matrix : ndarray (N, N)
            The Jacobian, then the row across.
        right : ndarray (N,)
            The right-hand side.

        Returns
        -------
        ndarray (N,)
            The step.

        Raises
        ------
        numpy.linalg.LinAlgError
            A singular matrix.
        """
        return np.asarray(np.linalg.solve(matrix, right), float)

    def along(self, jacobian: Array, before: Array) -> tuple[Array, float]:
        """Return the tangent that a Jacobian says, and a determinant.

        The determinant is that of the Jacobian bordered by the tangent: it changes its sign at a simple
        branch point.

        Parameters
        ----------
        jacobian : ndarray (N - 1, N)
            By scaled unknowns.
        before : ndarray (N,)
            The tangent before, along which the new one points.

        Returns
        -------
        tangent, determinant : ndarray (N,), float
            Of length 1; up to a factor that keeps its sign.

        Raises
        ------
        numpy.linalg.LinAlgError
            At a branch point.
        """
        bordered = np.vstack([jacobian, before])
        target = np.zeros(before.size)
        target[-1] = 1.0
        tangent = self.solve(bordered, target)
        length = float(np.linalg.norm(tangent))
        return tangent / length, self.determinant(bordered) * length

    def determinant(self, matrix: Array) -> float:
        """Determinant of bordered equations, up to a factor that keeps its sign.

        Parameters
        ----------
        matrix : ndarray (N, N)
            The bordered Jacobian.
        """
        sign, size = np.linalg.slogdet(matrix)
        return float(sign) * float(np.exp(size))
