"""Solve problems with one tool: ``python -m testset.worker TOOL LIMIT``, names in, a line of JSON for each out.

The process ends on a problem that takes more than LIMIT processor seconds.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
import warnings
from typing import Any

from . import peers
from .modes import NotForModes
from .problem import Problem, cases

OURS = "nonsmooth"


def outcome(tool: str, data: dict[str, Any]) -> dict[str, Any]:
    """Error and processor seconds of a tool on a problem, or why it has none."""
    problem = Problem(data)
    begin = time.process_time()
    spent = lambda: time.process_time() - begin
    try:
        if tool == OURS:
            run = problem.run()
            x = run.x[-1]
            problem.check(run)
        else:
            x = peers.PEERS[tool][1](problem)
    except NotForModes as error:
        return {"not for it": str(error)}
    except Exception as error:  # a tool may raise anything
        return {"failed": f"{type(error).__name__}: {error}"[:200], "seconds": spent()}
    seconds = spent()
    error = problem.error(x, problem.data["end"]) if "end" in problem.data else 0.0
    return {"error": float(error), "seconds": seconds, "within": problem.within("x")}


def main() -> None:
    """Answer each name that is read; what tools print goes nowhere."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    warnings.simplefilter("ignore")
    every = {data["id"]: data for data in cases()}
    for name in sys.stdin.read().split():
        signal.setitimer(signal.ITIMER_PROF, float(sys.argv[2]))
        found = outcome(sys.argv[1], every[name])
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        print(json.dumps(found), file=answers, flush=True)


if __name__ == "__main__":
    main()
