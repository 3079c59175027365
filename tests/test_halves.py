"""Two processes run every test once between them, and what they say together is true."""

import sys
import time

import pytest

from tests import halves

#: Stands for pytest: what it says, and its status, by the half it is told to be. It ends when both have
#: said theirs; without a status, when it is interrupted.
STAND = """
import os, signal, sys, time
from pathlib import Path
signal.signal(signal.SIGINT, lambda *_: (print("interrupted", flush=True), os._exit(2)))
half, place = os.environ["TESTS_HALF"], Path({place!r})
words, code = {answers!r}[half]
print(words, flush=True)
(place / half).touch()
while code is None or len(list(place.iterdir())) < 2:
    time.sleep(0.01)
sys.exit(code)
"""


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Run two stands for pytest, of (words, status) each."""

    def run(one, two, *arguments):
        text = STAND.format(answers={"1": one, "2": two}, place=str(tmp_path))
        monkeypatch.setattr(halves, "PYTEST", [sys.executable, "-I", "-S", "-c", text])
        return halves.main(arguments)

    return run


def test_each_file_is_in_one_half_and_both_have_many(monkeypatch):
    files = [p for f in ("tests", "papers") for p in (halves.ROOT / f).rglob("test_*.py")]
    mine = {}
    for half in ("1", "2"):
        monkeypatch.setenv(halves.NAME, half)
        mine[half] = {path for path in files if not halves.elsewhere(path)}
    assert mine["1"] | mine["2"] == {*files} and not mine["1"] & mine["2"]
    assert min(map(len, mine.values())) > 60
    monkeypatch.delenv(halves.NAME)
    assert not any(map(halves.elsewhere, files))


@pytest.mark.parametrize("name", ["flow", "model", "orbit", "proofs"])
def test_folders_of_the_first_half_are_there(name):
    assert halves.ROOT / "tests" / name in halves.FIRST
    assert (halves.ROOT / "tests" / name).is_dir()


@pytest.mark.parametrize(
    ("codes", "expected"),
    [((0, 0), 0), ((5, 0), 0), ((0, 5), 0), ((5, 5), 5), ((1, 0), 1), ((5, 1), 1), ((0, 2), 2), ((2, 1), 1), ((-9, 0), -9)],
)  # fmt: skip
def test_status_is_that_of_the_half_that_did_not_pass(codes, expected):
    assert halves.status(codes) == expected


def test_both_are_shown_in_order_with_what_failed_and_the_sum(run, capfdbinary):
    one = "..F\nFAILED tests/a.py::test_b - assert 1\n1 failed, 2 passed, 3 warnings in 4.00s"
    two = "....\n4 passed, 1 skipped, 5 deselected, 1 warning in 65.00s (0:01:05)"
    assert run((one, 1), (two, 0)) == 1
    said = capfdbinary.readouterr().out.decode()
    end = "FAILED tests/a.py::test_b - assert 1\nboth halves: 1 failed, 6 passed, 1 skipped, 5 deselected, 4 warnings"
    assert said == f"{one}\n{two}\n{end}\n"


def test_first_failure_ends_both_where_that_is_asked_for(run, capfdbinary):
    assert run(("1 passed in 1s", None), ("1 failed in 1s", 1), "-x") == 1
    assert "interrupted\n1 failed in 1s\n" in capfdbinary.readouterr().out.decode()


def test_an_interrupt_reaches_both_once(run, capfdbinary, monkeypatch, tmp_path):
    sleep, interrupted = time.sleep, []

    def interrupt_when_both_run(seconds):
        if len(list(tmp_path.iterdir())) == 2 and not interrupted:
            interrupted.append(True)
            raise KeyboardInterrupt
        sleep(seconds)

    monkeypatch.setattr(halves.time, "sleep", interrupt_when_both_run)
    assert run(("one", None), ("two", None)) == 2
    said = capfdbinary.readouterr().out.decode()
    assert said == "one\ninterrupted\ntwo\ninterrupted\nboth halves: no tests\n"
