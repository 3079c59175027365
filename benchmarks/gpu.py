"""An NVIDIA card: agreement with this processor, rates, and what its driver does; each step in a process of its own.

``python -m benchmarks --only gpu`` takes some five minutes. ``python -m benchmarks.gpu STEP`` runs one step here. What
a step finds is in ``build/benchmarks/gpu.json`` as soon as it ends, whatever becomes of the others.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import nonsmooth as ns
from nonsmooth.flow.constants import FALL_BACK
from nonsmooth.flow.engine import find_compiler
from nonsmooth.flow.engine.device import card as cards
from nonsmooth.flow.engine.device.card import Card, card
from nonsmooth.flow.engine.device.kernel import Given, Kernel, Source
from nonsmooth.flow.ensembles.on_device import device_order
from nonsmooth.flow.options import Options
from nonsmooth.flow.results import Chunk
from tests.flow.engine.device.cases import block_on_a_belt
from tests.flow.engine.device.shim import Shim

from .peers import diffrax_modes
from .problems import T_MAX, Array, bounce_system, random_starts
from .timing import ROOT

NAME = "gpu"

#: Seconds after which a step is ended.
_LONGEST = 100

#: Problems, and corners of their random starts: the two bounces, and a block that sticks and slips on a belt.
PROBLEMS: dict[str, tuple[Callable[[], ns.FilippovSystem], float, Array, Array]] = {
    name: (lambda name=name: bounce_system(name), T_MAX, low, high)  # type: ignore[misc]
    for name, low, high in [
        (n, np.array([0.0, 0.0, 0.0, -1.0, -2.0]), np.array([0.0, 2.0, 0.0, -1.0, 1.0]))
        for n in ("linear", "nonlinear")
    ]
} | {"stick-slip": (block_on_a_belt, 6.0, np.array([-1.0, -1.0]), np.array([1.0, 1.0]))}


def options_of(name: str) -> Options:
    """A run of a problem at the default tolerance."""
    return Options(t_end=PROBLEMS[name][1])


def starts_of(name: str, count: int) -> ns.RandomStarts:
    """Random starts, which a card draws itself."""
    return ns.RandomStarts(count, *PROBLEMS[name][2:])


def kernel_of(name: str, machine: Card) -> Kernel:
    """The kernel of a problem."""
    options = options_of(name)
    return Kernel(PROBLEMS[name][0](), device_order(options), machine)


def ends(name: str, x: Array, machine: Card) -> Chunk:
    """What a machine makes of starts (m, n), without the driver."""
    kernel = kernel_of(name, machine)
    chunk, p = Chunk.empty(len(x), kernel.system, False), kernel.system.parameter_vector()
    kernel.run(Given(Source.rows(x), 0, len(x), p, options_of(name)), None, chunk)
    return chunk


def the_card(quick: bool) -> dict[str, Any]:
    """The card, its driver, and what its compiler makes of the kernels."""
    command = ("nvidia-smi", "--query-gpu=driver_version,clocks.max.sm", "--format=csv,noheader")
    try:
        said = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    except OSError as error:
        said = str(error)
    found: dict[str, Any] = {"name": card().name, "driver, clock": said, "kernels": {}}
    for name in PROBLEMS:
        began, made = time.perf_counter(), kernel_of(name, card())
        kernel = made.compiled[0].get_kernel("trajectories")
        seconds = time.perf_counter() - began
        said_of = kernel.attributes
        found["kernels"][name] = {
            "order": made.order,
            "registers": int(said_of.num_regs()),
            "local bytes": int(said_of.local_size_bytes()),
            "seconds to compile": seconds,
        }
    return found


def bits(quick: bool) -> dict[str, Any]:
    """Runs with the same bits on the card and as C++ on this processor, nothing fused."""
    if find_compiler() is None:
        return {"failed": "no C++ compiler"}
    found, count = {}, 300 if quick else 20_000
    for name in PROBLEMS:
        x = starts_of(name, count).at(np.arange(count))
        a, b = (ends(name, x, machine) for machine in (card(False), Shim(fused=False)))
        same = (a.t == b.t) & np.all(a.x == b.x, axis=1) & (a.status == b.status)
        done = a.status != FALL_BACK
        words = [np.array([*c.words, ""], object)[c.itinerary] for c in (a, b)]
        found[name] = {
            "runs": count,
            "same bits": int(np.sum(same & done)),
            "same itinerary": int(np.sum((words[0] == words[1]) & done)),
            "to the driver": int(np.sum(~done)),
        }
    return found


def agreement(quick: bool) -> dict[str, Any]:
    """Whole ensembles there and here: itineraries, statuses, events, and the largest difference of a state."""
    found, count = {}, 300 if quick else 200_000
    for name, (make, t_end, _, _) in PROBLEMS.items():
        at = ("entry", 1) if name == "stick-slip" else None
        there, here = (
            ns.ensemble(make(), starts_of(name, count), t_end, device=device, at_event=at)
            for device in ("cuda", None)
        )
        different = there.itinerary != here.itinerary
        found[name] = {
            "runs": count,
            "different itineraries": int(different.sum()),
            "different statuses": int(np.sum(there.status != here.status)),
            "largest difference": float(np.abs(there.x - here.x)[~different].max()),
        }
        if at is not None:
            assert there.event_t is not None and here.event_t is not None
            apart = np.abs(there.event_t - here.event_t)[~different]
            missing = np.isnan(there.event_t) != np.isnan(here.event_t)
            found[name]["largest difference of event times"] = float(np.nanmax(apart))
            found[name]["events of one only"] = int(missing[~different].sum())
    return found


def starts(quick: bool) -> dict[str, Any]:
    """Starts that the card makes have the bits of those that are sent to it."""
    system, found = block_on_a_belt(), {}
    axes = [np.linspace(-1, 1, 70), np.linspace(0.1, 0.9, 50)]
    for name, drawn in (("grid", ns.Grid(axes)), ("random", starts_of("stick-slip", 3500))):
        rows = drawn.at(np.arange(3500))
        made, sent = (ns.ensemble(system, x, 2.0, device="cuda") for x in (drawn, rows))
        found[name] = {
            "runs": 3500,
            "same bits": int(np.all(made.x.reshape(-1, 2) == sent.x, axis=1).sum()),
        }
    return found


def seconds(work: Callable[[], Any], turns: int) -> float:
    """Median wall time of some turns after one untimed."""
    work()
    found = []
    for _ in range(turns):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return float(np.median(found))


def rates(quick: bool) -> dict[str, Any]:
    """Runs a second with starts made on the card: kernel alone, outcomes, and all results."""
    found, turns = {}, 1 if quick else 5
    for name, (make, t_end, low, high) in PROBLEMS.items():
        count, system = 1000 if quick else 1 << 24, make()
        kernel, box = kernel_of(name, card()), Source.box(low, high, 0)
        drawn, work = starts_of(name, count), ns.Work(progress=False)
        part, p = min(count, 1 << 22), system.parameter_vector()
        steps, left = np.empty(part, np.int32), [0]

        def alone(kernel=kernel, name=name, part=part, box=box, p=p, left=left) -> Any:  # type: ignore[no-untyped-def]
            memory, left[0] = kernel.start(Given(box, 0, part, p, options_of(name)), None)
            return memory

        card().read(alone()["steps"], steps)
        reduced = lambda drawn=drawn, system=system, work=work, t_end=t_end: ns.outcomes(
            system, drawn, t_end, device="cuda", work=work
        )
        whole = lambda drawn=drawn, system=system, work=work, t_end=t_end: ns.ensemble(
            system, drawn, t_end, device="cuda", work=work
        )
        found[name] = {
            "kernel": part / seconds(alone, turns),
            "outcomes": count / seconds(reduced, min(turns, 3)),
            "ensemble": count / seconds(whole, min(turns, 3)),
            "steps of a run": float(steps.mean()),
            "to the driver": left[0] / part,
        }
        print(name, found[name], flush=True)
    return found


def copies(quick: bool) -> dict[str, float]:
    """Bytes a second to the card and back."""
    array = np.random.default_rng(0).normal(size=1 << (16 if quick else 26))
    memory, back = card().write(array), np.empty_like(array)
    written = seconds(lambda: card().write(array), 3)
    read = seconds(lambda: card().read(memory, back), 3)
    return {"written": array.nbytes / written, "read": array.nbytes / read}


class OfPtx(Card):
    """The card, with kernels that its driver compiles."""

    def compile(self, source: str) -> Any:
        """Return the kernels, from PTX for a common architecture."""
        return self.program(source, cards.COMMON).compile("ptx")


def second_try(quick: bool) -> dict[str, Any]:
    """PTX compiled by the driver gives the bits of the code that NVRTC makes for the card, if nothing is fused."""
    import importlib

    core, count = importlib.import_module("cuda.core"), 300 if quick else 20_000
    x = random_starts(count, seed=5)
    began = time.perf_counter()
    a = ends("linear", x, OfPtx(core, False))
    spent = time.perf_counter() - began
    b = ends("linear", x, card(False))
    return {
        "runs": count,
        "same bits": int(np.all(a.x == b.x, axis=1).sum()),
        "seconds to compile and run": spent,
    }


def interrupts(quick: bool) -> dict[str, Any]:
    """Seconds after which Ctrl-C ends a long call."""
    system, work = block_on_a_belt(), ns.Work(progress=False)
    long = ns.RandomStarts(1 << (14 if quick else 24), [-1.0, 0.1], [1.0, 0.9])
    run = lambda t_end: ns.outcomes(system, long, t_end, tol=1e-13, device="cuda", work=work)
    ns.outcomes(system, ns.RandomStarts(100, [-1, 0.1], [1, 0.9]), 1.0, tol=1e-13, device="cuda")
    sent = [0.0]

    def interrupt() -> None:
        sent[0] = time.perf_counter()
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.3 if quick else 1.0, interrupt)
    timer.start()
    try:
        run(3.0e3)
    except KeyboardInterrupt:
        return {"seconds": time.perf_counter() - sent[0]}
    timer.cancel()
    return {"failed": "the call ended before it was interrupted"}


def peer(quick: bool) -> dict[str, Any]:
    """Linear bounces a second of diffrax on the same card."""
    if not diffrax_modes.available():
        return {"failed": "diffrax is not installed"}
    import jax

    if jax.default_backend() != "gpu":
        return {"failed": f"JAX runs on {jax.default_backend()}"}
    count = 1000 if quick else 100_000
    solve, x = diffrax_modes.make("linear", options_of("linear").rtol), random_starts(count)
    return {"linear": count / seconds(lambda: solve(x), 3)}


STEPS: dict[str, Callable[[bool], dict[str, Any]]] = {
    "card": the_card,
    "bits": bits,
    "rates": rates,
    "agreement": agreement,
    "starts": starts,
    "copies": copies,
    "second try": second_try,
    "interrupts": interrupts,
    "diffrax": peer,
}


def run(quick: bool, folder: Path) -> dict[str, Any]:
    """What each step finds, or why it failed."""
    found: dict[str, Any] = {}
    for name in STEPS:
        began = time.perf_counter()
        found[name] = _in_process(name, quick)
        print(f"{name}: {time.perf_counter() - began:.1f} s {json.dumps(found[name])}", flush=True)
        (folder / "gpu.json").write_text(json.dumps(found, indent=1))
        if name == "card" and "failed" in found[name]:
            break
    return found


def _in_process(name: str, quick: bool) -> dict[str, Any]:
    """Run a step in a process of its own: what one does to the driver is not the next one's."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "found.json"
        command = [sys.executable, "-m", "benchmarks.gpu", name, str(path), *["--quick"] * quick]
        try:
            done = subprocess.run(
                command, cwd=ROOT, stderr=subprocess.PIPE, text=True, timeout=_LONGEST, check=False
            )
        except subprocess.TimeoutExpired:
            return {"failed": f"not done after {_LONGEST} s"}
        if path.exists():
            return dict(json.loads(path.read_text()))
        return {"failed": done.stderr.strip()[-2000:] or f"it ended with {done.returncode}"}


def markdown(section: dict[str, Any], table: Any) -> str:
    """What was found as tables, or why there is nothing."""
    the = section["card"]
    if "failed" in the:
        return f"No card: {the['failed'].splitlines()[-1]}"
    parts = [f"On {the['name']}, driver and largest clock {the['driver, clock']}."]
    for name in ("bits", "agreement", "rates", "starts"):
        found = section.get(name, {})
        if not found or "failed" in found:
            parts.append(f"{name}: {_shown(found.get('failed', 'not run'))}")
            continue
        head = list(dict.fromkeys(key for row in found.values() for key in row))
        rows = [[one, *(_shown(row.get(key)) for key in head)] for one, row in found.items()]
        parts.append(table([name, *head], rows))
    for name in ("copies", "second try", "interrupts", "diffrax"):
        found = section.get(name, {})
        parts.append(f"{name}: " + ", ".join(f"{key} {_shown(v)}" for key, v in found.items()))
    return "\n\n".join(parts)


def _shown(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else str(value).splitlines()[-1]


if __name__ == "__main__":
    result = STEPS[sys.argv[1]]("--quick" in sys.argv)
    print(json.dumps(result, indent=1))
    if len(sys.argv) > 2 and not sys.argv[2].startswith("-"):
        Path(sys.argv[2]).write_text(json.dumps(result))
