"""Check proofs that ``save`` wrote, with nothing but Python's whole numbers and fractions.

    python checker proof.json

These files share no code with ``nonsmooth.proofs``: they have their own interval arithmetic,
functions, derivatives, polynomials and reading of the decision table.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from complete_lists import check_cover, check_list
from intervals import CheckError
from orbit_proofs import check_orbit
from periodic_orbits import check_periodic
from records import read
from special_points import check


def main(arguments: list[str]) -> int:
    """Check every proof of every file; return 1 if one fails, 2 without files."""
    if not arguments:
        print(__doc__)
        return 2
    failed = 0
    for name in arguments:
        try:
            claims = claimed(read(name))
            if not claims:
                raise CheckError("it claims nothing")
        except CheckError as error:
            failed += 1
            print(f"{name}: NOT CHECKED: {error!r}")
            continue
        for k, (work, given) in enumerate(claims):
            try:
                result = f"checked: {work(given)}"
            except Exception as error:  # whatever a damaged record raises in the checks
                result = f"NOT CHECKED: {error!r}"
            failed += not result.startswith("checked")
            print(f"{name}[{k}]: {result}")
    return int(failed > 0)


def claimed(text: dict[str, Any]) -> list[tuple[Callable[[Any], str], Any]]:
    """The claims of a file, each with the function that checks it."""
    work: list[tuple[Callable[[Any], str], Any]] = [(_point, r) for r in text.get("proofs", [])]
    if "ranges" in text:
        work.append((lambda t: check_cover(t["ranges"], t["proofs"]), text))
    if "list" in text:
        work.append((check_list, text["list"]))
    if "orbit" in text:
        work.append((check_orbit, text["orbit"]))
    return work


def _point(record: dict[str, Any]) -> str:
    if not record:
        raise CheckError("there is no proof")
    return check_periodic(record) if record.get("kind") == "periodic orbit" else check(record)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
