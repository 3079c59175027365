"""Tables in Markdown and pictures of the results."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nonsmooth.plot import style
from nonsmooth.plot.labels import Labels

from . import gpu
from .analysis import periodic_orbits, proof_checks
from .bouncing import bounces_in_space
from .runs import reading

#: Targets, and whether more or less is better.
TARGETS = {
    "linear bounce: times heyoka, one integrator per mode": (38.0, "at least"),
    "linear bounce: times scipy": (3000.0, "at least"),
    "nonlinear bounce: times heyoka, one integrator per mode": (19.0, "at least"),
    "nonlinear bounce: times scipy": (1800.0, "at least"),
    "linear sweep: 2 threads over 1": (1.8, "at least"),
    "nonlinear sweep: 2 threads over 1": (1.8, "at least"),
    "linear sweep: 2 threads over 1, fastest turns": (1.8, "at least"),
    "nonlinear sweep: 2 threads over 1, fastest turns": (1.8, "at least"),
    "few events, dense off: time over heyoka's": (1.0, "at most"),
    "few events, dense on: time over heyoka's": (0.2, "at most"),
    "many events, dense off: time over heyoka's": (1.0, "at most"),
    "many events, dense on: time over heyoka's": (0.2, "at most"),
    "a new system: simulate of 20 steps, each second": (3000.0, "at least"),
    "a new system: first result (s)": (0.03, "at most"),
    "a new system: 40 pendulums (s)": (1.0, "at most"),
    "first result, simulate, compiled, cold (s)": (1.5, "at most"),
    "first result, simulate, compiled, cached (s)": (0.4, "at most"),
    "first result, ensemble, cold (s)": (1.5, "at most"),
    "first result, ensemble, cached (s)": (0.4, "at most"),
    "import nonsmooth (s)": (0.25, "at most"),
    "1e7 bounces (GiB)": (3.0, "at most"),
    "proof: a two-fold with its class, to 1e-30 (s)": (0.05, "at most"),
    "proof: a linear bounce (s)": (0.05, "at most"),
    "proof: all 100 two-folds of a box (s)": (10.0, "at most"),
    "wrong or missing theorems": (0, "at most"),
    **{**periodic_orbits.TARGETS, **bounces_in_space.TARGETS, **reading.TARGETS},
    "wrong itineraries, random starts": (0, "at most"),
    "wrong itineraries, within 1e-9 of a boundary": (0, "at most"),
}

MODES = "heyoka, one integrator per mode"


def figures(results: dict[str, Any]) -> dict[str, float]:
    """Numbers to compare with TARGETS, of the sections that were run."""
    found: dict[str, float] = {}
    for name in ("linear", "nonlinear"):
        solvers = results.get("bounces", {}).get(name, {}).get("solvers", {})
        for label, key in ((MODES, MODES), ("scipy DOP853", "scipy")):
            if "rate" in solvers.get(label, {}):
                ratio = solvers["nonsmooth"]["rate"] / solvers[label]["rate"]
                found[f"{name} bounce: times {key}"] = ratio
        threads = results.get("scaling", {}).get(name)
        if threads:
            ratio = threads["1 thread"]["median"] / threads["2 threads"]["median"]
            found[f"{name} sweep: 2 threads over 1"] = ratio
            fastest = threads["1 thread"]["low"] / threads["2 threads"]["low"]
            found[f"{name} sweep: 2 threads over 1, fastest turns"] = fastest
    for belt, result in results.get("long runs", {}).items():
        for tail, word in (("", "off"), (", dense", "on")):
            pair = [result["solvers"].get(s + tail, {}) for s in ("nonsmooth", "heyoka")]
            if all("seconds" in s for s in pair):
                ratio = pair[0]["seconds"]["median"] / pair[1]["seconds"]["median"]
                found[f"{belt}, dense {word}: time over heyoka's"] = ratio
    for name, timing in results.get("proofs", {}).items():
        if f"proof: {name} (s)" in TARGETS:
            found[f"proof: {name} (s)"] = timing["median"]
    if "short runs" in results:
        short = results["short runs"]
        found["a new system: simulate of 20 steps, each second"] = 1 / short["simulate"]["low"]
        found["a new system: first result (s)"] = short["first result"]["low"]
        found["a new system: 40 pendulums (s)"] = short["40 pendulums"]["low"]
    if "theorems" in results:
        found["wrong or missing theorems"] = proof_checks.wrong(results["theorems"])
    found |= periodic_orbits.figures(results.get("orbits", {})) | bounces_in_space.figures(results)
    found |= reading.figures(results)
    return found | _startup(results) | _itineraries(results)


def _startup(results: dict[str, Any]) -> dict[str, float]:
    found = {}
    startup = results.get("startup", {})
    for key, case in (
        ("first result, simulate, compiled, cold (s)", "nonsmooth.simulate, compiled, cold"),
        ("first result, simulate, compiled, cached (s)", "nonsmooth.simulate, compiled, cached"),
        ("first result, ensemble, cold (s)", "nonsmooth.ensemble, 10,000 bounces, cold"),
        ("first result, ensemble, cached (s)", "nonsmooth.ensemble, 10,000 bounces, cached"),
        ("import nonsmooth (s)", "import nonsmooth"),
    ):
        if case in startup:
            found[key] = startup[case]["seconds"]
    if "memory" in results:
        found["1e7 bounces (GiB)"] = results["memory"]["peak MiB"] / 1024
    return found


def _itineraries(results: dict[str, Any]) -> dict[str, float]:
    sections = results.get("correctness", {}).values()
    if not sections:
        return {}
    random = sum(s["wrong at the default tolerance"] + s["wrong against mpmath"] for s in sections)
    near = sum(b["wrong"] for s in sections for b in s["boundaries"].values())
    return {
        "wrong itineraries, random starts": random,
        "wrong itineraries, within 1e-9 of a boundary": near,
    }


# Markdown ----------------------------------------------------------------------------------------


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def markdown(results: dict[str, Any]) -> str:
    """All tables of the results."""
    parts = [_machine(results), "## Targets\n\n" + _targets(results)]
    for name, section in results.get("bounces", {}).items():
        parts.append(f"## {name.capitalize()} bounce\n\n" + _bounce(results, name, section))
    for key, make in _SECTIONS.items():
        if key in results:
            parts.append(f"## {key.capitalize()}\n\n" + make(results[key]))
    return "\n\n".join(parts) + "\n"


def _machine(results: dict[str, Any]) -> str:
    m = results["machine"]
    return "Measured on " + ", ".join(f"{k}: {v}" for k, v in m.items()) + "."


def _targets(results: dict[str, Any]) -> str:
    rows = []
    found = figures(results)
    for name, (limit, sense) in TARGETS.items():
        if name in found:
            value = found[name]
            reached = value >= limit if sense == "at least" else value <= limit
            rows.append(
                [name, f"{sense} {limit:g}", f"{value:.3g}", "met" if reached else "**missed**"]
            )
    return table(["what", "target", "measured", ""], rows)


def _bounce(results: dict[str, Any], name: str, section: dict[str, Any]) -> str:
    rows = []
    limit = results.get("peak", {}).get("limits", {}).get(name)
    for label, s in section["solvers"].items():
        if "missing" in s:
            rows.append([label, "not installed", *[""] * 5])
            continue
        pick = s["pick"]
        reached = f"{pick['error']:.1e}" + ("" if s["reached"] else " (target not reached)")
        share = f"{100 * s['rate'] / limit:.2g}%" if limit else ""
        rows.append(
            [
                label,
                f"{s['rate']:,.0f}",
                f"{s['slowest']:,.0f} to {s['fastest']:,.0f}",
                f"{pick['tolerance']:g}",
                reached,
                f"{pick['wrong']} of {pick['of']}",
                share,
            ]
        )
    head = ["solver", "bounces/s", "spread", "tolerance", "max error", "wrong", "of ideal"]
    return table(head, rows)


def _long(section: dict[str, Any]) -> str:
    rows = []
    for belt, result in section.items():
        for label, s in result["solvers"].items():
            seconds = s.get("seconds")
            time = f"{1e3 * seconds['median']:.3g}" if seconds else "target not reached"
            spread = f"{1e3 * seconds['low']:.3g} to {1e3 * seconds['high']:.3g}" if seconds else ""
            tolerance, error = f"{s['pick']['tolerance']:g}", f"{s['pick']['error']:.1e}"
            events = f"{belt} ({result['events']})"
            rows.append([events, label, time, spread, tolerance, error])
    return table(["run", "solver", "ms", "spread", "tolerance", "error at the end"], rows)


def _start(section: dict[str, Any]) -> str:
    head = ["fresh process", "s", "least to most", "processor s", "whole process s", "peak MiB"]
    rows = [
        [
            name,
            f"{s['seconds']:.3f}",
            f"{s['low']:.3f} to {s['high']:.3f}",
            f"{s['processor time']:.3f}",
            f"{s['whole process']:.3f}",
            f"{s['peak MiB']:.0f}",
        ]
        for name, s in section.items()
    ]
    return table(head, rows)


def _memory(section: dict[str, Any]) -> str:
    return (
        f"{section['bounces']:,} bounces in one call: peak {section['peak MiB']:,.0f} MiB, of which "
        f"starts {section['starts_mib']:,.0f} and results {section['results_mib']:,.0f}."
    )


def _scaling(section: dict[str, Any]) -> str:
    rows = []
    for name, cases in section.items():
        for case, s in cases.items():
            rows.append(
                [name, case, f"{s['rate']:,.0f}", f"{s['median']:.3f}", f"{s['spread']:.0%}"]
            )
    return table(["bounce", "workers", "bounces/s", "s", "spread"], rows)


def _peak(section: dict[str, Any]) -> str:
    if "missing" in section:
        return section["missing"]
    limits = ", ".join(f"{name} {v:.3g} bounces/s" for name, v in section["limits"].items())
    return (
        f"One core: {section['Gflop/s']:.1f} Gflop/s in vectors of {section['lanes']:.0f}, "
        f"{section['scalar Gflop/s']:.1f} in scalars. Ideal arithmetic: {limits}."
    )


def _elsewhere(section: dict[str, Any]) -> str:
    rows = []
    for label, s in section.items():
        if "missing" in s:
            rows.append([label, "", "", s["missing"]])
        for row in s.get("rows", []):
            setting = f"{row['tolerance']:g}"
            rows.append([label, setting, f"{row['error']:.1e}", f"{1e3 * row['seconds']:.3g}"])
    return table(["solver", "step or tolerance", "error at t = 100", "ms"], rows)


def _folds(section: dict[str, Any]) -> str:
    rows = [
        [label, f"{s['rate']:,.0f}", f"{s['spread']:.0%}"]
        for label, s in section["solvers"].items()
    ]
    classes = ", ".join(f"{k} {v}" for k, v in section["classes"].items())
    return (
        f"{section['two-folds']} two-folds ({classes}); labels that differ: "
        f"{section['labels that differ']}.\n\n" + table(["by", "two-folds/s", "spread"], rows)
    )


def _proofs(section: dict[str, Any]) -> str:
    rows = [
        [name, f"{s['median']:.3g} s", f"{s['spread']:.0%}", "yes" if s["proven"] else "NO"]
        for name, s in section.items()
    ]
    return table(["theorem", "processor time", "spread", "proven"], rows)


def _correct(section: dict[str, Any]) -> str:
    rows = []
    for name, s in section.items():
        rows += [
            [name, "random, against tolerance 1e-14", f"{s['random starts']:,}"],
            [name, "random, against mpmath", f"{s['against mpmath']:,}"],
        ]
        keys = ("default tolerance", "mpmath")
        for row, key in zip(rows[-2:], keys, strict=True):
            row.append(str(next(v for k, v in s.items() if k.startswith("wrong") and key in k)))
        for pair, b in s["boundaries"].items():
            shown = f"within 1e-9, against mpmath: `{pair.replace(' | ', '` and `')}`"
            rows.append([name, shown, f"{b['starts']:,}", str(b["wrong"])])
    wrong = [
        f"- {name}: X' = {v!r}, Omega = {o!r}: `{given}`, mpmath `{right}`"
        for name, s in section.items()
        for b in s["boundaries"].values()
        for v, o, given, right in b["which"]
    ]
    found = table(["bounce", "starts", "number", "wrong"], rows)
    return found + ("\n\nThe wrong ones:\n\n" + "\n".join(wrong) if wrong else "")


def chain(section: dict[str, Any]) -> str:
    """The table of a result."""
    rows = []
    for label, s in section.items():
        if not isinstance(s, dict):
            continue
        if "missing" in s:
            rows.append([label, "", "", s["missing"]])
        for row in s.get("rows", []):
            cells = [f"{row['tolerance']:g}", f"{row['error']:.1e}", f"{row['seconds']:.3g}"]
            rows.append([label, *cells])
    head = ["solver", "step or tolerance", f"error at t = {section['t_end']:g}", "s"]
    events = section["nonsmooth"]["rows"][0]["events"]
    same = "the same" if section["same itinerary"] else "another"
    return (
        f"{section['blocks']} blocks, {events} events, {section['status']}; {same} itinerary at a "
        f"tolerance a thousand times smaller.\n\n" + table(head, rows)
    )


_SECTIONS: dict[str, Callable[[dict[str, Any]], str]] = {
    "long runs": _long,
    "elsewhere": _elsewhere,
    "chain": chain,
    "startup": _start,
    "scaling": _scaling,
    "memory": _memory,
    "peak": _peak,
    "two-folds": _folds,
    "proofs": _proofs,
    "theorems": proof_checks.markdown,
    "orbits": lambda section: periodic_orbits.markdown(section, table),
    bounces_in_space.NAME: lambda section: bounces_in_space.markdown(section, table),
    gpu.NAME: lambda section: gpu.markdown(section, table),
    reading.NAME: lambda section: reading.markdown(section, table),
    "correctness": _correct,
}


_BEGIN, _END = "<!-- results: python -m benchmarks --record -->", "<!-- end of the results -->"


def record(text: str, pictures: list[Path], folder: Path) -> None:
    """Put the tables between the marks of README.md, and the pictures beside it."""
    readme = folder / "README.md"
    before, _, rest = readme.read_text(encoding="utf-8").partition(_BEGIN)
    after = rest.partition(_END)[2]
    inner = text.replace("\n## ", "\n### ")
    readme.write_text(f"{before}{_BEGIN}\n\n{inner}\n{_END}{after}", encoding="utf-8")
    for picture in pictures:
        shutil.copyfile(picture, folder / picture.name)


# Pictures ----------------------------------------------------------------------------------------


def pictures(results: dict[str, Any], folder: Path) -> list[Path]:
    """Work-precision plots of the bounces, as PNG."""
    bounces = results.get("bounces", {})
    if not bounces:
        return []
    figure = style.new_figure((7.0, 3.6))
    axes = figure.subplots(1, len(bounces), sharey=True, squeeze=False)[0]
    for axis, (name, section) in zip(axes, bounces.items(), strict=True):
        _work_precision(axis, name, section)
    axes[0].set_ylabel("processor time per bounce [s]")
    figure.supxlabel(
        "largest error, drawn at most at $10^{-4}$; circled: wrong itineraries", fontsize=9
    )
    path = folder / "work_precision.png"
    figure.savefig(path, dpi=200)
    return [path]


#: Name, colour and mark of each solver in the picture.
_MARKS = {
    "nonsmooth": ("nonsmooth", style.BLUE, "o"),
    MODES: ("heyoka, each mode", style.VERMILLION, "s"),
    "heyoka, one integrator and callbacks": ("heyoka, callbacks", style.VERMILLION, "^"),
    "heyoka, 8 lanes per mode": ("heyoka, 8 lanes", style.VERMILLION, "v"),
    "scipy DOP853": ("scipy", style.GREEN, "D"),
    "scipy DOP853, numba": ("scipy, numba", style.GREEN, "+"),
    "diffrax Dopri8": ("diffrax", style.PURPLE, "*"),
}


#: Larger errors are drawn here.
_WORST = 1e-4


def _work_precision(axis: Any, name: str, section: dict[str, Any]) -> None:
    """Time against the largest error; rows with wrong itineraries are circled."""
    labels = Labels(axis)
    for label, s in section["solvers"].items():
        if "rows" not in s:
            continue
        called, colour, mark = _MARKS.get(label, (label, style.GREY, "."))
        rows = sorted(s["rows"], key=lambda r: -r["tolerance"])
        x, y = [min(r["error"], _WORST) for r in rows], [1 / r["rate"] for r in rows]
        axis.loglog(x, y, color=colour, marker=mark, ms=4, lw=0.8)
        right = [(e, t) for e, t, r in zip(x, y, rows, strict=True) if not r["wrong"]]
        labels.name(called, right or [*zip(x, y, strict=True)], colour)
        wrong = [(e, t) for e, t, r in zip(x, y, rows, strict=True) if r["wrong"]]
        if wrong:
            axis.loglog(*zip(*wrong, strict=True), "o", color=colour, ms=8, mfc="none", lw=0)
    axis.axvline(section["target"], color=style.GREY, lw=0.6, ls=":")
    axis.invert_xaxis()
    axis.set_title(f"{name} bounce")
    axis.grid(True, which="major", lw=0.3)
