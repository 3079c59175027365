"""The exceptions of the library."""

from __future__ import annotations


class NonsmoothError(Exception):
    """Root of every error raised by ``nonsmooth``; catch this to catch them all."""


class DefinitionError(NonsmoothError, ValueError):
    """The description of a system is inconsistent (shapes, foreign symbols, a constant surface)."""


class NotSmoothError(DefinitionError):
    """An expression holds an operation without derivatives of every order."""


class ParameterError(NonsmoothError, ValueError):
    """A parameter is unknown, missing or not a finite number."""


class PointError(NonsmoothError, ValueError):
    """A state has the wrong shape, is not finite, or is not a point that the function applies to."""


class OptionError(NonsmoothError, ValueError):
    """An option of a run (tolerance, end time, section) is out of its range."""


class ConvergenceError(NonsmoothError, RuntimeError):
    """An iteration stopped before its residual was small.

    Attributes
    ----------
    residual : float
        Norm of the equations at the last iterate.
    point : ndarray
        The last iterate.
    """

    def __init__(self, message: str, *, residual: float = float("nan"), point: object = None):
        super().__init__(message)
        self.residual = residual
        self.point = point


class DegenerateError(NonsmoothError, ValueError):
    """A genericity condition of the theory fails; the message names which one."""


class MissingError(NonsmoothError, ImportError):
    """A package that an extra of this library installs is missing."""


def explain(what: str, *, expected: object, received: object, advice: str) -> str:
    """Compose a message from what was expected, what was received, and advice."""
    return f"{what}: expected {expected}, received {received}. {advice}"
