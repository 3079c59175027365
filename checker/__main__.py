"""Check proofs that ``Proof.save`` wrote, with nothing but Python's whole numbers and fractions.

    python checker proof.json

These files share no code with the library that proves: they have their own interval arithmetic,
functions, derivatives, polynomials and reading of the decision table.
"""

from __future__ import annotations

import json
import sys

from claims import check
from intervals import CheckError


def main(arguments: list[str]) -> int:
    """Check every proof of every file; 1 if one fails."""
    if not arguments:
        print(__doc__)
        return 2
    failed = 0
    for name in arguments:
        with open(name, encoding="utf-8") as file:
            records = json.load(file)["proofs"]
        for k, record in enumerate(records):
            try:
                words = "checked: " + check(record) if record else "NOT CHECKED: there is no proof"
            except (CheckError, KeyError, IndexError, ValueError) as error:
                words = f"NOT CHECKED: {error!r}"
            failed += not words.startswith("checked")
            print(f"{name}[{k}]: {words}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
