"""The driver in C under the sanitizers, and its lines that no test runs.

    python -m tests.flow.instrumented sanitize [what pytest takes]
    python -m tests.flow.instrumented uncovered [what pytest takes]

By default both run the fast tests of ``tests/flow``. The second prints the lines of ``DECISIONS``
that were not run, or of the files named by ``NONSMOOTH_UNCOVERED`` (names with commas between).
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from nonsmooth.flow.engine import find_compiler, interpreter, library
from nonsmooth.flow.engine.building import core_source

ROOT = Path(__file__).parents[2]

#: Flags of each build.
BUILDS = {
    "sanitize": "-O1 -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all",
    "uncovered": "-O0 --coverage",
}

#: Files that decide: what the second command lists.
DECISIONS = (
    "blocks.c",
    "vectors.c",
    "decide.c",
    "events.c",
    "layer.c",
    "accumulation.c",
    "stability.c",
    "spiral.c",
)


def marked_source() -> str:
    """C of the driver, where each line has the name of its file."""
    plain = core_source.driver_text

    def marked(name: str) -> str:
        return f'#line 1 "{Path(name).name}"\n{plain(name)}'

    core_source.core_source.cache_clear()
    core_source.driver_text = marked
    try:
        return core_source.core_source()
    finally:
        core_source.driver_text = plain
        core_source.core_source.cache_clear()


def instrument(kind: str, folder: Path) -> None:
    """Compile the driver in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in [*folder.glob("core*"), *folder.glob("report*")]:
        old.unlink()
    (folder / "core.c").write_text(marked_source())
    command = [
        *(find_compiler() or ["cc"]),
        "-std=gnu11",
        "-g",
        "-w",
        "-fPIC",
        "-shared",
        "-ffp-contract=off",
    ]
    command += [*BUILDS[kind].split(), "core.c", "-o", "core.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)


def use(folder: Path) -> None:
    """Let this process run the driver of a folder."""
    loaded = ctypes.CDLL(str(folder / "core.so"))
    library._PACKAGED = folder / "none"
    library.build = lambda source: loaded
    interpreter.library.cache_clear()


def uncovered(folder: Path, names: list[str]) -> dict[str, list[int]]:
    """Lines of some files that were compiled and not run."""
    (data,) = folder.glob("*.gcda")
    found = subprocess.run(
        ["gcov", "--json-format", "--stdout", data.name],
        cwd=folder,
        capture_output=True,
        check=True,
    )
    runs: dict[str, dict[int, int]] = {}
    for file in json.loads(found.stdout)["files"]:
        counts = runs.setdefault(file["file"], {})
        for line in file["lines"]:
            number = line["line_number"]
            counts[number] = max(counts.get(number, 0), line["count"])
    return {n: sorted(k for k, c in runs[n].items() if not c) for n in names if n in runs}


def preloaded(folder: Path) -> dict[str, str]:
    """Environment in which a library under the address sanitizer loads; empty where there is none."""
    command = find_compiler()
    if command is None or len(command) > 1:
        return {}
    paths = []
    for name in (
        "libasan.so",
        "libstdc++.so.6",
    ):  # the second so that exceptions of CasADi are caught
        said = subprocess.run(
            [*command, f"-print-file-name={name}"], capture_output=True, text=True
        )
        paths.append(Path(said.stdout.strip()))
    if not all(path.is_absolute() and path.exists() for path in paths):
        return {}
    return {
        "LD_PRELOAD": " ".join(map(str, paths)),
        "ASAN_OPTIONS": f"detect_leaks=0:alloc_dealloc_mismatch=0:log_path={folder}/report",
        "UBSAN_OPTIONS": f"print_stacktrace=1:log_path={folder}/report",
    }


def main(kind: str, arguments: list[str]) -> int:
    """Run tests with an instrumented driver in a process of its own."""
    folder = ROOT / "build" / kind
    own = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_XDIST")}
    environment = {**own, **(preloaded(folder) if kind == "sanitize" else {})}
    environment |= {"NONSMOOTH_INSTRUMENT": f"{kind}:{folder}", "PYTHONPATH": str(ROOT)}
    others = [
        "engine/test_webassembly.py",
        "engine/building/test_library.py",
        "test_saved_files.py",
    ]
    given = arguments or [
        *("-m", "not slow and not slow_cases and not browser", "tests/flow"),
        *(
            f"--ignore=tests/flow/{name}" for name in others
        ),  # processes without the driver's library
    ]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "tests.flow.instrumented",
        "-p",
        "no:cacheprovider",
    ]
    done = subprocess.run([*command, "--tb=short", *given], env=environment, cwd=ROOT)
    for report in folder.glob("report*"):
        print(report.read_text())
    if kind == "uncovered":
        names = os.environ.get("NONSMOOTH_UNCOVERED", ",".join(DECISIONS)).split(",")
        for name, lines in uncovered(folder, names).items():
            (source,) = (ROOT / "nonsmooth" / "flow" / "core").rglob(name)
            text = source.read_text().splitlines()
            print(f"{name}: {len(lines)} of {len(text)} lines were not run")
            for line in lines:
                print(f"  {line:4d} {text[line - 1].strip()}")
    return done.returncode


@pytest.hookimpl(tryfirst=True)
def pytest_configure() -> None:
    """As a plug-in of pytest: build before tests are collected, once for all workers."""
    kind, _, folder = os.environ["NONSMOOTH_INSTRUMENT"].partition(":")
    if "PYTEST_XDIST_WORKER" not in os.environ:
        instrument(kind, Path(folder))
    use(Path(folder))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
