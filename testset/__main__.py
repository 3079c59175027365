"""Run the test set and write build/testset/: ``python -m testset [--record] [--python PATH ...] [TOOL ...]``.

Results are kept as they come, and a run continues where it was interrupted; ``--python`` names further interpreters with
tools, ``--record`` puts the table into README.md.
"""

from __future__ import annotations

import argparse
import datetime
import json
import shlex
import signal
import statistics
import subprocess
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .peers import PEERS
from .problem import CASES, Problem, cases
from .worker import OURS

ROOT = CASES.parents[1]
FOLDER = ROOT / "build" / "testset"
#: Errors above this are wrong; of tools at a tolerance of 1e-10, and of first-order time steps.
WRONG = 1e-3
#: Processor seconds of a tool for one problem, with what it compiles.
LIMIT = 60.0
OVER = f"over {LIMIT:.0f} s"
#: Results are valid as long as these stay.
SOURCES = ("modes", "peers", "problem", "worker")
#: Finds the version of the distribution that has a module.
VERSION = """
import importlib.util as u, importlib.metadata as m, sys
name = sys.argv[1]
if u.find_spec(name):
    try:
        print(m.version(m.packages_distributions().get(name, [name])[0]))
    except m.PackageNotFoundError:
        print(__import__(name).__version__)
"""


def version(python: str, module: str) -> str:
    """Version of a module in an interpreter, empty if it is not there."""
    asked = subprocess.run(
        [python, "-c", VERSION, module], cwd=ROOT, capture_output=True, text=True
    )
    return asked.stdout.strip()


def solve(
    python: str, tool: str, own: list[dict[str, Any]], path: Path, key: str, limit: float = LIMIT
) -> None:
    """Complete the results of a tool; a new process takes over where one ended on a problem."""
    kept = json.loads(path.read_text()) if path.exists() else {}
    keys = {
        data["id"]: zlib.crc32(f"{key} {json.dumps(data, sort_keys=True)}".encode()) for data in own
    }
    found = {name: kept[name] for name in keys if kept.get(name, {}).get("key") == keys[name]}
    while left := [name for name in keys if name not in found]:
        worker = subprocess.Popen(
            [python, "-m", "testset.worker", tool, str(limit)],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert worker.stdin and worker.stdout
        worker.stdin.write(" ".join(left))
        worker.stdin.close()
        for name in left:
            line = worker.stdout.readline()
            code = 0 if line else worker.wait()
            over = {"failed": OVER if code == -signal.SIGPROF else f"the process ended ({code})"}
            found[name] = {**(json.loads(line) if line else over), "key": keys[name]}
            path.write_text(json.dumps(found, indent=1))
            if not line:
                break


def wrong(found: dict[str, Any]) -> list[str]:
    """Problems whose end is wrong without a message."""
    done = {name: own for name, own in found.items() if "error" in own}
    return [name for name, own in done.items() if not own["error"] <= max(WRONG, own["within"])]


def row(tool: str, found: dict[str, Any]) -> str:
    """A line of the table."""
    bad = wrong(found)
    over = [name for name, own in found.items() if own.get("failed") == OVER]
    failed = [name for name, own in found.items() if "failed" in own and name not in over]
    not_for = [name for name, own in found.items() if "not for it" in own]
    right = [own for name, own in found.items() if name not in {*bad, *over, *failed, *not_for}]
    middle = [statistics.median([own[key] for own in right] or [0]) for key in ("error", "seconds")]
    counts = map(len, (found, right, bad, failed, over, not_for))
    return (
        "| " + " | ".join(map(str, (tool, *counts, f"{middle[0]:.0e}", f"{middle[1]:.2f}"))) + " |"
    )


def table(results: dict[str, dict[str, Any]]) -> str:
    """All tools, and the names of what is silently wrong."""
    head = (
        "| tool | problems | right | silently wrong | gave up | "
        f"{OVER} | cannot be written | median error | median s |"
    )
    lines = [head, "|---|" + "--:|" * 8, *(row(*pair) for pair in results.items())]
    names = (f"- {tool}: {', '.join(wrong(found)) or 'none'}" for tool, found in results.items())
    return "\n".join([*lines, "", "Silently wrong are:", "", *names])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the tools that are installed and print the table."""
    parser = argparse.ArgumentParser(prog="python -m testset", description=__doc__)
    parser.add_argument("tools", nargs="*", metavar="TOOL")
    parser.add_argument("--python", action="append", default=[], metavar="PATH")
    parser.add_argument("--record", action="store_true", help="put the table into README.md")
    given = parser.parse_args(arguments)
    FOLDER.mkdir(parents=True, exist_ok=True)
    sources = [CASES.with_name(f"{name}.py").read_bytes() for name in SOURCES]
    results = dict[str, dict[str, Any]]()
    for tool, module in ({OURS: OURS} | {name: own[0] for name, own in PEERS.items()}).items():
        if given.tools and tool not in given.tools:
            continue
        there = ((python, version(python, module)) for python in (sys.executable, *given.python))
        python, number = next((pair for pair in there if pair[1]), ("", ""))
        if not python:
            print(f"{tool}: not installed")
            continue
        path = FOLDER / f"{tool}.json"
        if tool == OURS:
            path.unlink(missing_ok=True)
        own = [data for data in cases() if tool == OURS or "end" in Problem(data).data]
        solve(python, tool, own, path, f"{number} {zlib.crc32(b''.join(sources))}")
        results[f"{tool} ({number})"] = json.loads(path.read_text())
    words = shlex.join(
        ["python", "-m", "testset", *(sys.argv[1:] if arguments is None else arguments)]
    )
    text = f"{table(results)}\n\nMade on {datetime.date.today()} by `{words}`."
    if given.record:
        page = CASES.with_name("README.md")
        before, _, rest = page.read_text(encoding="utf-8").partition("<!-- results -->\n")
        after = rest.partition("<!-- end of results -->\n")[2]
        marked = f"<!-- results -->\n{text}\n<!-- end of results -->\n"
        page.write_text(before + marked + after, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
