"""Check of proofs by other methods: complete lists by Newton's method, bounces by mpmath.

For random systems Newton's method finds the zeros of a complete list, and no others. For random bounces
itineraries and ends are those of ``reference``, which shares no code with the library.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

import nonsmooth as ns

from .. import reference
from ..problems import T_MAX, bounce_system, code, random_starts

#: The box of all lists.
BOX = [(-1.5, 1.5), (-1.5, 1.5), (-1.0, 1.0)]


@dataclass
class Lists:
    """Counts over random systems."""

    systems: int = 0
    complete: int = 0
    zeros: int = 0
    starts: int = 0
    missed: list[Any] = field(default_factory=list)
    twice: list[Any] = field(default_factory=list)
    unfound: list[Any] = field(default_factory=list)

    @property
    def sound(self) -> bool:
        """Whether every list was complete and right."""
        wrong = self.missed or self.twice or self.unfound
        return self.complete == self.systems and not wrong


def random_system(rng: np.random.Generator, k: int) -> ns.FilippovSystem:
    """Lie derivatives that are random cubics, some with a sine or exponential; plane or curved."""
    x, y, z = (ca.SX.sym(s) for s in "xyz")
    monomials = [1, x, y, z, x**2, y**2, x * y, x**3, y**3, x * y**2]
    f, g = (
        sum(float(c) * m for c, m in zip(rng.normal(size=len(monomials)), monomials, strict=True))
        for _ in "fg"
    )
    if k % 3 == 1:
        f = f + ca.sin(2 * x * y)
    if k % 3 == 2:
        g = g + ca.exp(0.5 * x) - ca.cos(y)
    surface = z + 0.1 * x * y if k % 2 else z
    return ns.FilippovSystem([x, y, z], surface=surface, above=[1, 1, f], below=[1, -1, g])


def lists(seed: int, systems: int, starts: int) -> Lists:
    """Compare complete lists of two-folds with Newton's method from random starts."""
    rng, found = np.random.default_rng(seed), Lists()
    low, high = np.array(BOX).T
    for k in range(systems):
        system = random_system(rng, k)
        census = ns.prove_all(system, BOX)
        found.systems += 1
        found.complete += census.complete
        found.zeros += len(census.zeros)
        found.starts += starts
        with np.errstate(over="ignore", invalid="ignore"):  # starts that run away
            tangent = lambda p, s=system: ns.find_two_fold(s, p)
            newton = [f.point for f in ns.find_all(tangent, rng.uniform(low, high, (starts, 3)))]
        proven = np.array([[v.middle for v in p.point.values()] for p in census.zeros])
        proven = proven.reshape(-1, 3)
        for p in newton:
            near = np.min(np.linalg.norm(proven - p, axis=1), initial=np.inf)
            if np.all((low <= p) & (p <= high)) and near > 1e-8:
                found.missed.append((k, p.tolist()))
        for i, p in enumerate(proven):
            if np.min(np.linalg.norm(np.delete(proven, i, 0) - p, axis=1), initial=1.0) < 1e-9:
                found.twice.append((k, p.tolist()))
            again = ns.find_two_fold(system, p + 1e-7 * rng.normal(size=3))
            if np.linalg.norm(again.point - p) > 1e-9:
                found.unfound.append((k, p.tolist()))
    return found


def bounces(name: str, seed: int, count: int) -> dict[str, Any]:
    """Prove random landings of the ``linear`` or ``nonlinear`` bounce, and compare with mpmath."""
    starts = random_starts(count, seed=seed)
    solution = reference.solve(name, starts)
    system = bounce_system(name)
    result: dict[str, Any] = {"starts": count, "proven": 0, "wrong itineraries": [], "outside": []}
    widest = 0.0
    for i, x in enumerate(starts):
        proof = ns.certify_orbit(system, list(x), T_MAX)
        result["proven"] += proof.proven and proof.status == "lift-off"
        if code(proof.itinerary) != solution.itinerary[i]:
            result["wrong itineraries"].append(i)
        # The reference is rounded to doubles.
        ends = [(proof.t, solution.t[i]), *zip(proof.end.values(), solution.x[i], strict=True)]
        if any(abs(e.middle - v) > e.radius + 1e-15 * (1 + abs(v)) for e, v in ends):
            result["outside"].append(i)
        widest = max(widest, *(e.radius for e, _ in ends))
    return result | {"widest": widest}


def run(quick: bool) -> dict[str, Any]:
    """Count over 500 systems and 500 bounces."""
    found = lists(4, 10 if quick else 500, 30 if quick else 300)
    each = 5 if quick else 250
    result = {
        "lists": vars(found) | {"sound": found.sound},
        "bounces": {name: bounces(name, 9, each) for name in ("linear", "nonlinear")},
    }
    print(f"  {result}", flush=True)
    return result


def wrong(section: dict[str, Any]) -> int:
    """Theorems that are wrong or were not found."""
    found = section["lists"]
    count = sum(len(found[k]) for k in ("missed", "twice", "unfound"))
    count += found["systems"] - found["complete"]
    for s in section["bounces"].values():
        count += len(s["wrong itineraries"]) + len(s["outside"]) + s["starts"] - s["proven"]
    return count


def markdown(section: dict[str, Any]) -> str:
    """The table of a result."""
    found = section["lists"]
    counts = ", ".join(f"{k} {len(found[k])}" for k in ("missed", "twice", "unfound"))
    cases = f"{found['systems']}, {found['starts']:,} starts"
    lines = [
        "| theorems, checked by | random cases | proven | wrong |",
        "| --- | --- | --- | --- |",
        f"| lists of two-folds, Newton's method | {cases} | {found['complete']} complete, "
        f"{found['zeros']} two-folds | {counts} |",
    ]
    lines += [
        f"| {name} bounces, mpmath | {s['starts']} | {s['proven']} | itineraries "
        f"{len(s['wrong itineraries'])}, ends {len(s['outside'])} |"
        for name, s in section["bounces"].items()
    ]
    return "\n".join(lines)
