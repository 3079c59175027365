"""Generate tables and the gallery from the code, so that the pages agree with it.

A line `<!-- generated: name -->` of a page is replaced by the text that the function of this name in
`PARTS` returns, while the site is built.
"""

from __future__ import annotations

import inspect
import re
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

import bounce
import nonsmooth as ns
from nonsmooth.flow.status import ADVICE
from nonsmooth.local.two_folds.classification import TABLE

from .animations import animations
from .elsewhere import measured
from .markdown_table import first_line, table

DOCS = Path(__file__).parents[1]
EXAMPLES = DOCS / "examples"

#: The gallery, in the order of the page.
GALLERY = tuple(
    """
    two_fold two_fold_space atlas funnel stick_slip leine friction_drive pushed_block belt relay
    plane_friction harvest stommel hybrid buck conduction walker impact soft_impact chatter
    synchrony basins wells friction_cone outcome_map slip_directions
""".split()
)


def decision_table() -> str:
    """The classes of two-folds, from the table that classifies them."""
    signs = {"VV": "(+1, -1)", "II": "(-1, +1)", "VI": "(+1, +1)", "IV": "(-1, -1)"}
    rows = [
        (
            f"**{row.label}**",
            " or ".join(f"${signs[kind]}$" for kind in row.folds),
            f"${latex(row.condition)}$",
            row.into,
            row.out_of,
        )
        for row in TABLE
    ]
    return table(
        ("class", "$\\sigma$", "condition", "orbits of Da that reach s", "that come from s"), rows
    )


def meanings() -> str:
    """What each class means for determinism, as the classification says it."""
    return "\n\n".join(f"**{row.label}**\n:   {row.determinism}" for row in TABLE)


_LATEX = (
    (r"\bkappa_([-+])", r"\\kappa_{\1}"),
    (r"\bnu([12])\b", r"\\nu_\1"),
    (r"\bgap\b", r"\\mathrm{gap}"),
    (r"\bDelta\b", r"\\Delta"),
    (r" and ", r" \\text{ and } "),
    (r" \(", r" \\quad ("),
    (r", (?=[A-Z\\])", r",\\; "),
)


def latex(condition: str) -> str:
    """A condition of the decision table as LaTeX."""
    for pattern, written in _LATEX:
        condition = re.sub(pattern, written, condition)
    return condition


def examples_of_classes() -> str:
    """One two-fold of each class, as the textbook builds it."""
    rows = []
    for label, (sigma, nu) in ns.textbook.TWO_FOLDS.items():
        found = ns.two_folds.classify_two_fold(sigma, nu)
        counts = (
            "∞" if c == float("inf") else f"{c:g}" for c in (found.canards, found.faux_canards)
        )
        rows.append((f"**{label}**", f"${sigma}$", f"${nu}$", found.kind, *counts))
    return table(("class", "$\\sigma$", "$\\nu$", "folds", "canards", "faux canards"), rows)


def status_table() -> str:
    """Every way a run can end, with its advice."""
    rows = ((f"`{s.name}`", int(s), "yes" if s.complete else "", ADVICE[s]) for s in ns.Status)
    return table(("status", "value", "complete", "advice"), rows)


def error_table() -> str:
    """Every exception and warning, which builtin it also is, and when it is raised."""
    rows = []
    for module in (ns, ns.orbit, ns.proofs, bounce, bounce.golf):
        for name in module.__all__:
            thing = getattr(module, name)
            if not (inspect.isclass(thing) and issubclass(thing, (ns.NonsmoothError, Warning))):
                continue
            builtin = next(c for c in thing.__mro__ if c.__module__ == "builtins").__name__
            rows.append((f"`{module.__name__}.{name}`", f"`{builtin}`", first_line(thing)))
    return table(("exception", "is also a", "when"), rows)


def obligations() -> str:
    """What a contact model provides, in the words of the base class."""
    text = inspect.getdoc(bounce.ContactModel) or ""
    found = re.search(r"To write a contact model.*?(?=\n\nParameters\n---)", text, re.DOTALL)
    assert found is not None, "ContactModel's docstring has no numbered obligations"
    return found.group().replace("``", "`")


def problems() -> str:
    """The textbook's problems."""
    rows = (
        (f"`{p.name}`", p.title, p.source, len(p.references))
        for p in (build() for build in ns.textbook.PROBLEMS.values())
    )
    return table(("name", "title", "source", "known values"), rows)


def problem_pictures() -> str:
    """A run of each of them."""
    shown = [
        f"**{p.title}** (`{p.name}`)\n\n![States of a run of {p.name} over time](gallery/textbook_{p.name}.png)"
        for p in (build() for build in ns.textbook.PROBLEMS.values())
    ]
    return "\n\n".join(shown)


def draw_problems(folder: Path) -> list[Path]:
    """Draw a run of each textbook problem into a folder."""
    paths = []
    for name, build in ns.textbook.PROBLEMS.items():
        figure = ns.plot.trajectory(build().run())
        paths.append(folder / f"textbook_{name}.png")
        figure.savefig(paths[-1], bbox_inches="tight", dpi=80, metadata={"Software": None})
        plt.close(figure)
    return paths


def regions() -> str:
    """What the fields do at a point of the surface."""
    when = {
        ns.Region.ATTRACTING: "$L_1 < 0 < L_2$",
        ns.Region.REPELLING: "$L_2 < 0 < L_1$",
        ns.Region.CROSSING_UP: "$L_1, L_2 > 0$",
        ns.Region.CROSSING_DOWN: "$L_1, L_2 < 0$",
        ns.Region.TANGENT_ABOVE: "$L_1 = 0$",
        ns.Region.TANGENT_BELOW: "$L_2 = 0$",
        ns.Region.TWO_FOLD: "$L_1 = L_2 = 0$",
        ns.Region.MIXED: "on an intersection of surfaces",
        ns.Region.SLIDING: "on a set of codimension two or three, where friction can hold",
        ns.Region.CROSSING: "on such a set, where friction cannot hold",
        ns.Region.BOUNDARY: "on such a set, between these two",
    }
    return table(
        ("where", "region", "name"), ((when[r], str(r), f"`Region.{r.name}`") for r in ns.Region)
    )


# Gallery ------------------------------------------------------------------------------------------


#: Programs that draw several pictures, `figures`, and what each shows.
PAGES = {
    "atlas": (
        "visible two-folds",
        "invisible two-folds",
        "visible-invisible two-folds with few canards",
        "visible-invisible two-folds with many",
        "the classes over nu1 and nu2",
    )
}


def example(name: str) -> Path:
    """The program of this name, in the folder of its subject."""
    (path,) = EXAMPLES.glob(f"*/{name}.py")
    return path


def run_example(name: str) -> dict[str, Any]:
    """Run a program of the gallery and return what it defines; `figure` is its picture."""
    return runpy.run_path(str(example(name)), run_name=name)


def pictures(name: str) -> list[tuple[str, str]]:
    """Names of the pictures of a program of the gallery, without a suffix, and what each shows."""
    if name in PAGES:
        return [(f"{name}-{k}", text) for k, text in enumerate(PAGES[name], 1)]
    return [(name, described(name)[0])]


def drawn(name: str, defined: dict[str, Any]) -> dict[str, Any]:
    """The figures of a program that ran, by the names of their pictures."""
    figures = defined["figures"] if name in PAGES else [defined["figure"]]
    return dict(zip((picture for picture, _ in pictures(name)), figures, strict=True))


def described(name: str) -> tuple[str, str, str]:
    """Return title, text and source of a program of the gallery."""
    source = example(name).read_text(encoding="utf-8")
    found = re.match(r'"""(.*?)\n\n(.*?)\n"""\n', source, re.DOTALL)
    assert found is not None, f"{name}.py: expected a docstring of a title and a text"
    return found.group(1), found.group(2), source


def gallery() -> str:
    """The gallery: title, text, picture and program of each example."""
    parts = []
    for name in GALLERY:
        title, text, source = described(name)
        program = "\n".join("    " + line if line else "" for line in source.splitlines())
        shown = "\n\n".join(
            f"[![{about}](gallery/{picture}.svg)](gallery/{picture}.svg){{ title='Enlarge' }}"
            for picture, about in pictures(name)
        )
        parts.append(
            f"## {title}\n\n{text}\n\n{shown}\n\n"
            f'??? example "The program: `{example(name).relative_to(DOCS.parent).as_posix()}`"\n\n'
            f"    ```python\n{program}\n    ```\n"
        )
    return "\n".join(parts)


# Explorers ----------------------------------------------------------------------------------------


def explorers() -> dict[str, str]:
    """The pages that compute in the browser, by their address in the site."""
    return {
        "explore/stick_slip.html": _stick_slip().html,
        "explore/teixeira.html": _teixeira().html,
        "explore/two_folds.html": ns.plot.two_fold_explorer(),
        "explore/bounce.html": bounce.explore().html,
    }


def _stick_slip() -> Any:
    """The page of the program in explore.md, with a title."""
    text = (DOCS / "explore.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    exec(re.findall(r"```python\n(.*?)page = ", text, re.DOTALL)[0], names)
    ranges = {"belt": (0.05, 1.0), "friction": (0.0, 1.0)}
    title = "A block on a belt sticks and slips"
    return ns.explore(names["stick_slip"], start=[0.0, 0.0], parameters=ranges, title=title)


def _teixeira() -> Any:
    fold = ns.find_two_fold(ns.textbook.PROBLEMS["two_fold"]().system, near=[0.0, 0.1, 0.1])
    start = [0.25, 0.4, 0.5]
    return ns.explore(fold, start=start, t_end=10.0, title="A Teixeira two-fold")


# Pages --------------------------------------------------------------------------------------------

PARTS: dict[str, Callable[[], str]] = {
    f.__name__: f
    for f in (
        decision_table,
        meanings,
        animations,
        measured,
        examples_of_classes,
        status_table,
        error_table,
        obligations,
        problems,
        problem_pictures,
        regions,
        gallery,
    )
}

MARKER = re.compile(r"^<!-- generated: (\w+) -->$", re.MULTILINE)


def fill(markdown: str) -> str:
    """Replace each marker of a page by its part."""
    return MARKER.sub(lambda found: PARTS[found.group(1)](), markdown)
