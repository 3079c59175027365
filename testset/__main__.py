"""Run the test set and write build/testset/: ``python -m testset [--more] [TOOL ...]``."""

from __future__ import annotations

import json
import statistics
import sys
import time
import warnings
from collections.abc import Sequence
from typing import Any

from . import peers
from .modes import GaveUp, NotForModes
from .problem import CASES, Problem, cases

OURS = "nonsmooth"
ROOT = CASES.parents[1]
FOLDER = ROOT / "build" / "testset"
#: Errors above this are wrong; of tools at a tolerance of 1e-10, and of first-order time steps.
WRONG = 1e-3


def outcome(tool: str, data: dict[str, Any]) -> dict[str, Any]:
    """Error and seconds of a tool on a problem, or why it has none."""
    problem = Problem(data)
    begin = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if tool == OURS:
                run = problem.run()
                x = run.x[-1]
                problem.check(run)
            else:
                x = peers.PEERS[tool][1](problem)
    except NotForModes as error:
        return {"not for it": str(error)}
    except (
        GaveUp,
        AssertionError,
        ArithmeticError,
        RuntimeError,
        ValueError,
        TypeError,
        KeyError,
    ) as error:
        return {
            "failed": f"{type(error).__name__}: {error}"[:200],
            "seconds": time.perf_counter() - begin,
        }
    seconds = time.perf_counter() - begin
    error = problem.error(x, problem.data["end"]) if "end" in problem.data else 0.0
    return {"error": float(error), "seconds": seconds, "within": problem.within("x")}


def row(tool: str, found: dict[str, Any]) -> str:
    """A line of the table."""
    done = [own for own in found.values() if "error" in own]
    right = [own for own in done if own["error"] <= max(WRONG, own["within"])]
    failed = [own for own in found.values() if "failed" in own]
    not_for = [own for own in found.values() if "not for it" in own]
    errors = sorted(own["error"] for own in right)
    middle = f"{statistics.median(errors):.0e}" if errors else ""
    seconds = f"{statistics.median(own['seconds'] for own in right):.3f}" if right else ""
    cells = (tool, len(right), len(done) - len(right), len(failed), len(not_for), middle, seconds)
    return "| " + " | ".join(map(str, cells)) + " |"


def table(results: dict[str, dict[str, Any]]) -> str:
    """All tools."""
    head = "| tool | right | silently wrong | failed with a message | cannot be written | median error | median seconds |"
    return "\n".join(
        [head, "|---|--:|--:|--:|--:|--:|--:|", *(row(*pair) for pair in results.items())]
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run tools that are installed, keep the results of the others from the last run."""
    chosen = [*(sys.argv[1:] if arguments is None else arguments)]
    more = "--more" in chosen
    chosen = [name for name in chosen if name != "--more"]
    FOLDER.mkdir(parents=True, exist_ok=True)
    tools = {OURS: "nonsmooth"} | {name: own[0] for name, own in peers.PEERS.items()}
    results = dict[str, dict[str, Any]]()
    for tool, module in tools.items():
        path = FOLDER / f"{tool}.json"
        if (tool in chosen or not chosen) and peers.installed(module):
            own = [data for data in cases() if tool == OURS or "end" in Problem(data).data]
            found = json.loads(path.read_text()) if more and path.exists() else {}
            for data in own:
                if data["id"] not in found:
                    found[data["id"]] = outcome(tool, data)
                    path.write_text(json.dumps(found, indent=1))
        if path.exists():
            results[tool] = json.loads(path.read_text())
    (FOLDER / "results.md").write_text(table(results) + "\n", encoding="utf-8")
    print(table(results))


if __name__ == "__main__":
    main()
