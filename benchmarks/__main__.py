"""Run benchmarks and write build/benchmarks/: ``python -m benchmarks [--quick] [--only SECTION ...]``."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from . import burridge_knopoff, gpu, report
from .analysis import periodic_orbits, proof_checks, proof_times, two_folds
from .bouncing import bounces, bounces_in_space, itineraries
from .runs import long_runs, other_interpreters, reading, resources, short_runs, startup
from .timing import ROOT, machine

BOUNCES = ("linear", "nonlinear")
FOLDER = ROOT / "build" / "benchmarks"


def sections(folder: Path, quick: bool) -> dict[str, Callable[[], Any]]:
    """The sections by name."""
    return {
        "peak": resources.peak,
        "bounces": lambda: {name: bounces.run(name, folder, quick) for name in BOUNCES},
        bounces_in_space.NAME: lambda: bounces_in_space.run(quick),
        "long runs": lambda: long_runs.run(quick),
        "elsewhere": lambda: other_interpreters.run(quick),
        "chain": lambda: burridge_knopoff.run(quick),
        gpu.NAME: lambda: gpu.run(quick, folder),
        "orbits": lambda: periodic_orbits.run(quick),
        "two-folds": lambda: two_folds.run(quick),
        "proofs": lambda: proof_times.run(quick),
        "theorems": lambda: proof_checks.run(quick),
        reading.NAME: lambda: reading.run(quick),
        "short runs": lambda: short_runs.run(quick),
        "startup": lambda: startup.run(quick),
        "memory": lambda: resources.memory(quick),
        "scaling": lambda: resources.scaling(quick),
        "correctness": lambda: {name: itineraries.run(name, folder, quick) for name in BOUNCES},
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the chosen sections; results of the others are kept from the last run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="small sizes: a minute, not for figures"
    )
    parser.add_argument("--only", nargs="+", metavar="SECTION", choices=[*sections(FOLDER, True)])
    parser.add_argument("--folder", type=Path, help="where results go (build/benchmarks)")
    parser.add_argument("--record", action="store_true", help="put the results into README.md too")
    options = parser.parse_args(arguments)
    folder = options.folder or (FOLDER / "quick" if options.quick else FOLDER)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "results.json"
    results: dict[str, Any] = json.loads(path.read_text()) if options.only and path.exists() else {}
    results["machine"] = machine()
    for name, run in sections(folder, options.quick).items():
        if options.only and name not in options.only:
            continue
        print(f"{name} (load {os.getloadavg()[0]:.1f})", flush=True)
        results[name] = run()
        path.write_text(json.dumps(results, indent=1))
    text = report.markdown(results)
    (folder / "results.md").write_text(text, encoding="utf-8")
    pictures = report.pictures(results, folder)
    if options.record:
        report.record(text, pictures, Path(__file__).parent)
    print(text)
    print(f"benchmarks: {os.path.relpath(path)}, results.md, work_precision.png")


if __name__ == "__main__":
    main()
