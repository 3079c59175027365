"""Run the test set and write build/testset/: ``python -m testset [--more] [--record] [TOOL ...]``.

``--more`` runs problems that a tool has not run yet, ``--record`` puts the table into README.md.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
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


def wrong(found: dict[str, Any]) -> list[str]:
    """Problems whose end is wrong without a message."""
    done = {name: own for name, own in found.items() if "error" in own}
    return [name for name, own in done.items() if own["error"] > max(WRONG, own["within"])]


def row(tool: str, found: dict[str, Any]) -> str:
    """A line of the table."""
    bad, failed, not_for = (
        wrong(found),
        *([name for name, own in found.items() if key in own] for key in ("failed", "not for it")),
    )
    right = [own for name, own in found.items() if name not in {*bad, *failed, *not_for}]
    middle = (
        [statistics.median(own[key] for own in right) for key in ("error", "seconds")]
        if right
        else [0.0] * 2
    )
    counts = map(len, (found, right, bad, failed, not_for))
    return (
        "| " + " | ".join(map(str, (tool, *counts, f"{middle[0]:.0e}", f"{middle[1]:.2f}"))) + " |"
    )


def table(results: dict[str, dict[str, Any]]) -> str:
    """All tools, and the names of what is silently wrong."""
    head = "| tool | problems | right | silently wrong | gave up | cannot be written | median error | median s |"
    lines = [head, "|---|--:|--:|--:|--:|--:|--:|--:|", *(row(*pair) for pair in results.items())]
    names = (f"- {tool}: {', '.join(wrong(found)) or 'none'}" for tool, found in results.items())
    return "\n".join([*lines, "", "Silently wrong are:", "", *names])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run tools that are installed, keep the results of the others from the last run."""
    chosen = [*(sys.argv[1:] if arguments is None else arguments)]
    more, record = "--more" in chosen, "--record" in chosen
    chosen = [name for name in chosen if not name.startswith("--")]
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
    if record:
        page = Path(__file__).with_name("README.md")
        before, _, rest = page.read_text(encoding="utf-8").partition("<!-- results -->\n")
        after = rest.partition("<!-- end of results -->\n")[2]
        marked = f"<!-- results -->\n{table(results)}\n<!-- end of results -->\n"
        page.write_text(before + marked + after, encoding="utf-8")
    print(table(results))


if __name__ == "__main__":
    main()
