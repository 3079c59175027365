"""Pytest in two processes at once, each with half of the files: ``python -m tests.halves ARGUMENTS``.

What the first process says is shown as it comes, what the second says after it, then what failed in the
first once more and the sum of both. Each collects its own files only, which takes less processor time
than workers that collect everything and one more process that deals out tests to them.
"""

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Folders of the first half, which take about as long as everything else does, the second half.
FIRST = [ROOT / "tests" / name for name in ("flow", "model", "orbit", "proofs")]
#: Says to pytest (conftest.py) which half it is; without it, it is both.
NAME = "TESTS_HALF"
PYTEST = [sys.executable, "-m", "pytest"]
#: Statuses of pytest: nothing failed; no test was left of those asked for.
PASSED, NOTHING = 0, 5
#: Arguments that end a run at its first failure.
FIRST_ONLY = {"-x", "--exitfirst", "--maxfail=1"}


def half_of(path: Path) -> int:
    """The half that a file belongs to, 1 or 2."""
    return 1 if any(path.is_relative_to(folder) for folder in FIRST) else 2


def elsewhere(path: Path) -> bool:
    """Whether a file belongs to the other half, which another process runs."""
    return os.environ.get(NAME, "") not in ("", str(half_of(path)))


class Half:
    """One of the two processes, in a group of its own: an interrupt reaches it once, from here."""

    def __init__(self, number: int, arguments: Sequence[str]) -> None:
        own = ["-o", f"cache_dir=.pytest_cache/half{number}", "--last-failed-no-failures=none"]
        colour = ["--color=yes"] if sys.stdout.isatty() else []
        self.words = tempfile.TemporaryFile()
        self.run = subprocess.Popen(
            [*PYTEST, *own, *colour, *arguments],
            env=os.environ | {NAME: str(number)},
            stdin=subprocess.DEVNULL,
            stdout=self.words,
            stderr=subprocess.STDOUT,
            process_group=0,
        )
        self.shown = 0

    def show(self) -> None:
        """Print what it has said since the last time."""
        while text := os.pread(self.words.fileno(), 65536, self.shown):
            self.shown += len(text)
            sys.stdout.buffer.write(text)
        sys.stdout.flush()

    def text(self) -> str:
        """All it has said, without colours."""
        text = os.pread(self.words.fileno(), self.shown, 0).decode(errors="replace")
        return re.sub(r"\x1b\[[\d;]*m", "", text)

    def signal(self, number: int) -> None:
        """Send a signal to it and its children, if it still runs."""
        if self.run.poll() is None:
            os.killpg(self.run.pid, number)


def main(arguments: Sequence[str]) -> int:
    """Run both halves; the status of one that did not pass, or 5 where neither had a test."""
    first_only = bool(FIRST_ONLY.intersection(arguments))
    halves = [Half(number, arguments) for number in (1, 2)]
    try:
        try:
            follow(halves, first_only)
        except KeyboardInterrupt:
            for half in halves:
                half.signal(signal.SIGINT)
            follow(halves, first_only=False)
    finally:
        for half in halves:
            half.signal(signal.SIGKILL)
    print(*closing([half.text() for half in halves]), sep="\n", flush=True)
    return status([half.run.returncode for half in halves])


def follow(halves: Sequence[Half], first_only: bool) -> None:
    """Show what one half says, then the other, until both have ended."""
    for half in halves:
        running = True
        while running:
            running = half.run.poll() is None
            half.show()
            if first_only and any(h.run.poll() not in (None, PASSED, NOTHING) for h in halves):
                for other in halves:
                    other.signal(signal.SIGINT)
                first_only = False
            if running:
                time.sleep(0.1)


def status(codes: Sequence[int]) -> int:
    """The status of both halves from theirs: a failure is told rather than that the other half was stopped."""
    failed = [code for code in codes if code not in (PASSED, NOTHING)]
    return min(failed, key=abs, default=min(codes))


def closing(texts: Sequence[str]) -> list[str]:
    """What failed in the first half, which the second half's words have pushed away, and the sum."""
    failed = re.findall(r"^(?:FAILED|ERROR) .*$", texts[0], re.MULTILINE)
    sums: Counter[str] = Counter()
    for text in texts:
        # the last of such lines, which may not be the last of all
        *_, last = ["", *re.findall(r"^.*\d [a-z]+.* in [\d.]+s\b.*$", text, re.MULTILINE)]
        for number, what in re.findall(r"(\d+) ([a-z]+)", last.rpartition(" in ")[0]):
            sums[what.rstrip("s")] += int(number)
    names = ("failed", "passed", "skipped", "deselected", "xfailed", "xpassed", "warning", "error")
    said = [f"{sums[n]} {n}{'s' * (n in names[-2:] and sums[n] > 1)}" for n in names if sums[n]]
    return [*failed, f"both halves: {', '.join(said) or 'no tests'}"]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
