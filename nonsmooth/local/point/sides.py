"""The two sides of a surface as letters, ``+`` (h > 0, field F1) and ``-`` (h < 0, field F2)."""

from __future__ import annotations

from typing import Literal

from ...model import DefinitionError, explain

Side = Literal["+", "-"]

#: In the order in which fields, Lie derivatives and Jacobians are listed.
SIDES: tuple[Side, Side] = ("+", "-")

#: The fields in words.
FIELDS: dict[str, str] = {"+": "F1 (above)", "-": "F2 (below)"}


def side_index(side: object) -> int:
    """0 for ``+`` and 1 for ``-``."""
    if side not in SIDES:
        raise DefinitionError(
            explain(
                "side",
                expected="'+' (the field F1, h > 0) or '-' (F2, h < 0)",
                received=repr(side),
                advice="Folds and equilibria belong to one of the two fields.",
            )
        )
    return SIDES.index(side)


def other(side: Side) -> Side:
    """The other side."""
    return "-" if side == "+" else "+"
