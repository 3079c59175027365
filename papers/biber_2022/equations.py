"""Every displayed equation of the paper, in order, with its check."""

from __future__ import annotations

from collections.abc import Callable

from .records import Equation

ALL: tuple[Callable[[], Equation], ...] = ()
