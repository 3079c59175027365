"""Bounces on an NVIDIA card: rates, and bits compared with the same text as C++.

The peer is diffrax, if JAX has the card too.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import nonsmooth as ns
from nonsmooth.flow.constants import HAND_OVER
from nonsmooth.flow.engine.device.card import card
from nonsmooth.flow.engine.device.kernel import Kernel, Source
from nonsmooth.flow.engine.device.machine import DeviceError, Machine
from nonsmooth.flow.options import Options
from nonsmooth.flow.results import Chunk
from tests.flow.engine.device.shim import Shim

from .peers import diffrax_modes
from .problems import T_MAX, Array, bounce_system, random_starts

NAME = "gpu"
OPTIONS = Options(t_end=T_MAX)

#: Corners of the starts of ``random_starts``.
LOW, HIGH = np.array([0.0, 0.0, 0.0, -1.0, -2.0]), np.array([0.0, 2.0, 0.0, -1.0, 1.0])


def ends(name: str, x: Array, machine: Machine) -> Chunk:
    """Results of a machine for starts (m, 5), without those that fall back to the CPU."""
    system, chunk = bounce_system(name), Chunk.empty(len(x), bounce_system(name), False)
    kernel = Kernel(system, OPTIONS.order, machine)
    kernel.run(Source.rows(x), 0, len(x), system.parameter_vector(), OPTIONS, None, chunk)
    return chunk


def compared(name: str, count: int, one: Machine, two: Machine) -> dict[str, Any]:
    """Number of bounces with the same bits and itinerary on two machines, and of those that fall back."""
    a, b = (ends(name, random_starts(count, seed=5), machine) for machine in (one, two))
    same = (a.t == b.t) & np.all(a.x == b.x, axis=1) & (a.status == b.status)
    words = [np.array([*c.words, ""], object)[c.itinerary] for c in (a, b)]
    return {
        "bounces": count,
        "same bits": int(same.sum()),
        "same itinerary": int(np.sum(words[0] == words[1])),
        "handed over": int(np.sum(a.status == HAND_OVER)),
    }


def seconds(work: Any, turns: int) -> float:
    """Least wall time of some turns after one untimed, as the card works asynchronously."""
    work()
    found = []
    for _ in range(turns):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return min(found)


def rates(name: str, count: int, machine: Machine, turns: int) -> dict[str, float]:
    """Bounces a second with starts made on the card: kernel alone, outcomes, and all results."""
    system, p = bounce_system(name), bounce_system(name).parameter_vector()
    kernel, box = Kernel(system, OPTIONS.order, machine), Source.box(LOW, HIGH, 0)

    def alone() -> None:
        kernel.start(box, 0, count, p, OPTIONS, None)
        machine.wait()

    starts = ns.RandomStarts(count, LOW, HIGH)
    work = ns.Work(progress=False)
    whole = lambda: ns.ensemble(system, starts, T_MAX, device="cuda", work=work)
    reduced = lambda: ns.outcomes(system, starts, T_MAX, device="cuda", work=work)
    return {
        "kernel alone": count / seconds(alone, turns),
        "outcomes": count / seconds(reduced, turns),
        "ensemble": count / seconds(whole, turns),
    }


def peer(count: int) -> float | None:
    """Bounces a second of diffrax on the same card, the linear ones; None without JAX there."""
    if not diffrax_modes.available():
        return None
    import jax

    if jax.default_backend() != "gpu":
        return None
    solve, x = diffrax_modes.make("linear", OPTIONS.rtol), random_starts(count)
    return count / seconds(lambda: solve(x), 3)


def run(quick: bool) -> dict[str, Any]:
    """Bits, rates and the peer's rate, or why there are none."""
    try:
        fast, plain = card(True), card(False)
    except DeviceError as error:
        print(f"no card: {error}")
        return {"none": str(error)}
    count = 100_000 if quick else 1 << 24
    found: dict[str, Any] = {"card": fast.name, "bits": {}, "rates": {}}
    for name in ("linear", "nonlinear"):
        found["bits"][name] = compared(name, 10_000, plain, Shim(fused=False))
        found["rates"][name] = rates(name, count, fast, 5)
    return {**found, "diffrax": peer(1000 if quick else 100_000)}


def markdown(section: dict[str, Any], table: Any) -> str:
    """Rates and equal bits as a table, or why there are none."""
    if "none" in section:
        return f"No card: {section['none']}"
    rows = [
        [name, *(f"{r[k]:,.0f}" for k in ("kernel alone", "outcomes", "ensemble"))]
        + [f"{section['bits'][name][k]:,}" for k in ("bounces", "same bits", "handed over")]
        for name, r in section["rates"].items()
    ]
    head = [
        "bounces",
        "a second, kernel",
        "a second, outcomes",
        "a second, ensemble",
        "compared",
        "same bits",
        "run here",
    ]
    said = (
        ""
        if section["diffrax"] is None
        else f" diffrax: {section['diffrax']:,.0f} linear a second."
    )
    return f"{table(head, rows)}\n\nOn {section['card']}.{said}"
