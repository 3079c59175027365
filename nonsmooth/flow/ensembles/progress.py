"""Progress bar of a long computation, on a terminal only."""

from __future__ import annotations

from typing import Any


class _NoBar:
    def update(self, count: float = 1) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def progress_bar(total: int | None, shown: bool, unit: str = "run") -> Any:
    """Return a bar on a terminal, for work of more than a second; nothing elsewhere."""
    if not shown:
        return _NoBar()
    from tqdm import tqdm  # only where a bar is shown

    return tqdm(total=total, disable=None, delay=1.0, unit=unit, unit_scale=True)
