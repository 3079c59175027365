"""Impacts: which gaps are closed, and the impulses that open them.

At an impact each contact that takes part gets an impulse that turns its rate v into -e v, and those
at rest stay so; an impulse pulls nowhere. Friction at the contact acts with the impulse in the same
proportion as with the reaction: slip that does not change its sign takes all of it, slip that stops
only what stops it. All possibilities are tried, the present sign of slip first.

Source: Brogliato 2016, "Nonsmooth mechanics", ch. 5 (Newton's restitution with several contacts);
Kane & Levinson 1985 for Coulomb's law with Newton's coefficient.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from ...model import Array, Coupled, Evaluator, FilippovSystem, Surfaces
from ..constants import ON_SURFACE
from ..options import Options
from .modes import rounding_scale


class Contacts:
    """The impacts of a system at given parameters."""

    def __init__(
        self,
        system: FilippovSystem,
        coupled: Coupled,
        surfaces: Surfaces,
        p: Array,
        options: Options,
    ):
        self._system, self._coupled, self._surfaces = system, coupled, surfaces
        self._p, self._options = p, options
        self._first, self._count = system.surface_count, len(system.impacts)
        restitutions = system.definition.restitutions
        self._restitution = Evaluator(system.function("restitution", lambda: [restitutions]))

    def gaps(self, x: Array) -> tuple[Array, Array]:
        """Gaps and their rates (c,), exactly zero where they are so to rounding."""
        h, gradient = self._surfaces.values(x, self._p)
        scale = rounding_scale(np.abs(gradient), x, self._options.size)
        rounded = np.where(np.abs(h) <= ON_SURFACE * scale, 0.0, h)[self._first :]
        return rounded[: self._count], rounded[self._count :]

    def behind(self, x: Array) -> int | None:
        """A contact whose gap is negative, if there is one."""
        gaps, _ = self.gaps(x)
        found = np.flatnonzero(gaps < 0.0)
        return int(found[0]) if found.size else None

    def touched(self, x: Array) -> list[int]:
        """Contacts whose gap is negative by no more than the tolerance of the run."""
        h, gradient = self._surfaces.values(x, self._p)
        scale = rounding_scale(np.abs(gradient), x, self._options.size) * self._options.rtol
        gaps = h[self._first : self._first + self._count]
        near = scale[self._first : self._first + self._count]
        return np.flatnonzero((gaps < 0.0) & (gaps >= -near)).tolist()

    def improper(self, x: Array, involved: Sequence[int]) -> int | None:
        """One of some contacts whose restitution is not from 0 to 1, if there is one."""
        e = self._restitution(x, self._p)[0][:, 0]
        return next((j for j in involved if not 0.0 <= e[j] <= 1.0), None)

    def strike(self, x: Array, mode: str, involved: Sequence[int], plastic: bool) -> Array | None:
        """State after the impulses at some closed gaps; None if none are consistent."""
        # ``plastic`` leaves no rates, whatever the restitution.
        rates = self._surfaces.values(x, self._p)[0][self._first + self._count :]
        e = np.zeros(self._count) if plastic else self._restitution(x, self._p)[0][:, 0]
        target = np.where(rates < 0.0, -(1.0 + e) * rates, -rates)
        if plastic:
            target = -rates
        for taking, letters in self._possibilities(mode, involved):
            after = self._try(x, mode, involved, taking, letters, target, plastic)
            if after is not None:
                return after
        return None

    def _possibilities(
        self, mode: str, involved: Sequence[int]
    ) -> Iterator[tuple[tuple[int, ...], dict[int, str]]]:
        """Contacts with an impulse, and letters of the surfaces that they carry."""
        carried = [
            i for i in range(self._first) if any(j in involved for j in self._coupled.carriers[i])
        ]
        orders = [mode[i] + "".join(c for c in "s+-" if c != mode[i]) for i in carried]
        subsets = sorted(product((True, False), repeat=len(involved)), key=lambda s: -sum(s))
        for subset in subsets:
            taking = tuple(j for j, yes in zip(involved, subset, strict=True) if yes)
            for choice in product(*orders):
                if taking:
                    yield taking, dict(zip(carried, choice, strict=True))

    def _try(
        self,
        x: Array,
        mode: str,
        involved: Sequence[int],
        taking: Sequence[int],
        letters: dict[int, str],
        target: Array,
        plastic: bool,
    ) -> Array | None:
        """State after the impulses of one possibility, or None if it contradicts itself."""
        coupled, m = self._coupled, self._first
        held = coupled.held(mode)
        for i, letter in letters.items():
            held[i] = {"+": 1.0, "-": -1.0, "s": 0.0}[letter]
        stuck = [i for i, letter in letters.items() if letter == "s"]
        unknown = [*stuck, *[m + j for j in taking]]
        none = np.zeros(coupled.count)
        slope = coupled.error_scales(x, held, none, self._p).slope
        h, gradient = self._surfaces.values(x, self._p)
        wanted = np.concatenate([-h[stuck], target[list(taking)]])
        try:
            impulses = np.linalg.solve(slope[np.ix_(unknown, unknown)], wanted)
        except np.linalg.LinAlgError:
            return None
        every = np.zeros(coupled.count)
        every[unknown] = impulses
        normal = every[m:]
        # With the impulses in place of reactions the factors are the limits of friction.
        reactions = held.copy()
        reactions[m:] = normal
        limits = np.abs(coupled.error_scales(x, reactions, none, self._p).factors[:m])
        pulls = not plastic and np.any(normal[list(taking)] < 0.0)
        slips = np.any(np.abs(every[stuck]) > limits[stuck] * (1 + 1e-9) + 1e-300)
        if not np.all(np.isfinite(impulses)) or pulls or (slips and not plastic):
            return None
        moved = h[:m] + slope[:m, unknown] @ impulses
        scale = ON_SURFACE * rounding_scale(np.abs(gradient), x, self._options.size)
        turned = any(held[i] and held[i] * moved[i] < -scale[i] for i in letters)
        rates = h[m + self._count :] + slope[m:, unknown] @ impulses
        closing = any(rates[j] < -scale[m + self._count + j] for j in involved if j not in taking)
        if turned or closing:
            return None
        return x + coupled.columns(x, held, self._p)[:, unknown] @ impulses
