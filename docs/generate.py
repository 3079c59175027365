"""What the pages take from the code, so that it cannot drift: tables, gallery, the API's pages.

A page asks for a part with a line `<!-- generated: name -->`; the name is a function of `PARTS`.
`hooks.py` puts the text there while the site is built. Nothing here needs mkdocs.
"""

from __future__ import annotations

import inspect
import re
import runpy
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import bounce
import nonsmooth as ns
from nonsmooth.flow.status import ADVICE
from nonsmooth.local.two_folds.classification import TABLE

DOCS = Path(__file__).parent
EXAMPLES = DOCS / "examples"

#: The gallery, in the order of the page.
GALLERY = (
    "two_fold",
    "two_fold_space",
    "atlas",
    "funnel",
    "stick_slip",
    "leine",
    "harvest",
    "basins",
    "wells",
    "friction_cone",
    "outcome_map",
)


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Lay out a Markdown table; bars in a cell are kept apart from those of the table."""
    lines = [list(head), *([str(cell).replace("|", r"\|") for cell in row] for row in rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def decision_table() -> str:
    """The classes of two-folds, from the table that classifies them."""
    signs = {"VV": "(+1, −1)", "II": "(−1, +1)", "VI": "(+1, +1)", "IV": "(−1, −1)"}
    rows = [
        (
            f"**{row.label}**",
            " or ".join(signs[kind] for kind in row.folds),
            f"`{row.condition}`",
            row.into,
            row.out_of,
            row.determinism,
        )
        for row in TABLE
    ]
    head = ("class", "σ", "condition", "orbits of Da that reach s", "that come from s", "meaning")
    return table(head, rows)


def examples_of_classes() -> str:
    """One two-fold of each class, as the textbook builds it."""
    rows = []
    for label, (sigma, nu) in ns.textbook.TWO_FOLDS.items():
        found = ns.two_folds.classify_two_fold(sigma, nu)
        counts = (
            "∞" if c == float("inf") else f"{c:g}" for c in (found.canards, found.faux_canards)
        )
        rows.append((f"**{label}**", f"`{sigma}`", f"`{nu}`", found.kind, *counts))
    return table(("class", "σ", "ν", "folds", "canards", "faux canards"), rows)


def status_table() -> str:
    """Every way a run can end, with its advice."""
    rows = ((f"`{s.name}`", int(s), "yes" if s.complete else "", ADVICE[s]) for s in ns.Status)
    return table(("status", "value", "complete", "advice"), rows)


def error_table() -> str:
    """Every exception and warning, which builtin it also is, and when it is raised."""
    rows = []
    for module in (ns, bounce, bounce.golf):
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


def regions() -> str:
    """What the fields do at a point of the surface."""
    when = {
        ns.Region.ATTRACTING: "L1 < 0 < L2",
        ns.Region.REPELLING: "L2 < 0 < L1",
        ns.Region.CROSSING_UP: "L1, L2 > 0",
        ns.Region.CROSSING_DOWN: "L1, L2 < 0",
        ns.Region.TANGENT_ABOVE: "L1 = 0",
        ns.Region.TANGENT_BELOW: "L2 = 0",
        ns.Region.TWO_FOLD: "L1 = L2 = 0",
        ns.Region.MIXED: "on an intersection of surfaces",
    }
    return table(
        ("where", "region", "name"), ((when[r], str(r), f"`Region.{r.name}`") for r in ns.Region)
    )


def first_line(thing: object) -> str:
    """First line of a docstring."""
    return (inspect.getdoc(thing) or "").partition("\n")[0].replace("``", "`")


# Gallery ------------------------------------------------------------------------------------------


def run_example(name: str) -> dict[str, Any]:
    """Run a program of the gallery and return what it defines; `figure` is its picture."""
    return runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name=name)


def described(name: str) -> tuple[str, str, str]:
    """Return title, text and source of a program of the gallery."""
    source = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    found = re.match(r'"""(.*?)\n\n(.*?)\n"""\n', source, re.DOTALL)
    assert found is not None, f"{name}.py: expected a docstring of a title and a text"
    return found.group(1), found.group(2), source


def gallery() -> str:
    """The gallery: title, text, picture and program of each example."""
    parts = []
    for name in GALLERY:
        title, text, source = described(name)
        program = "\n".join("    " + line if line else "" for line in source.splitlines())
        parts.append(
            f"## {title}\n\n{text}\n\n![{title}](gallery/{name}.svg)\n\n"
            f'??? example "The program: `docs/examples/{name}.py`"\n\n'
            f"    ```python\n{program}\n    ```\n"
        )
    return "\n".join(parts)


# API ----------------------------------------------------------------------------------------------

#: Page, its first lines, and whose names of the top level it lists.
FLOORS = {
    "model": "What a nonsmooth system is: states, parameters, fields, surfaces, stops and resets.",
    "local": "What happens at a point of a surface, without time stepping.",
    "flow": "Moving through time.",
    "orbit": "What needs both: sets of futures, branches of solutions, curves of two-folds.",
    "proofs": "Theorems in interval arithmetic, by the extra `proofs` (python-flint).",
}


#: Rooms of the ball whose types are met as attributes of results, and are not at the top.
ROOMS = ("contact", "shot", "maps")


def api_pages() -> dict[str, str]:
    """Return the pages of the API: every public name of both packages, by floor."""
    pages = {"api/index.md": _overview()}
    for floor, about in FLOORS.items():
        names = [n for n in ns.__all__ if _floor(ns, n) == floor]
        pages[f"api/{floor}.md"] = _page(f"nonsmooth: {floor}", about, "nonsmooth", names)
    pages["api/local.md"] += "\n" + _members("nonsmooth.local", returned_types())
    for package in (ns.plot, ns.textbook, ns.two_folds, ns.continuation, ns.plot.style):
        short = package.__name__.rpartition(".")[2]
        path = "nonsmooth." + ("plot.style" if package is ns.plot.style else short)
        pages[f"api/{short}.md"] = _page(path, _words(package), path, _own(package))
    names = [n for n in bounce.__all__ if _documented(getattr(bounce, n))]
    names += [f"{r}.{n}" for r in ROOMS for n in getattr(bounce, r).__all__]
    pages["api/bounce.md"] = _page("bounce", first_line(bounce), "bounce", names)
    for room in (bounce.golf, bounce.laws):
        path = room.__name__
        pages[f"api/{path.replace('.', '_')}.md"] = _page(path, _words(room), path, _own(room))
    names = [n for n, thing in vars(bounce.plot).items() if _draws(n, thing)]
    pages["api/bounce_plot.md"] = _page(
        "bounce.plot", first_line(bounce.plot), "bounce.plot", names
    )
    return pages


def _overview() -> str:
    lists = []
    doors = {
        "nonsmooth": (ns, ns.__all__),
        "nonsmooth.two_folds": (ns.two_folds, ns.two_folds.__all__),
        "nonsmooth.continuation": (ns.continuation, ns.continuation.__all__),
        "nonsmooth.local": (ns.local, returned_types()),
        "bounce": (bounce, bounce.__all__),
        "bounce.golf": (bounce.golf, bounce.golf.__all__),
        "bounce.laws": (bounce.laws, bounce.laws.__all__),
    }
    for path, (module, names) in doors.items():
        rows = [
            (f"[`{name}`][{path}.{name}]", first_line(getattr(module, name)))
            for name in names
            if _documented(getattr(module, name))
        ]
        lists.append(f"## {path}\n\n" + table(("name", "what it is"), rows))
    intro = (
        "Both packages have one front door: their top level, with the verbs, the nouns and the "
        "errors. The algebra of two-folds, which needs no system, is in `nonsmooth.two_folds`, "
        "curves of any equations are followed by `nonsmooth.continuation`, and "
        "the types that questions about a point return are in `nonsmooth.local`. What is before, between "
        "and after bounces is in `bounce.golf`, laws in closed form are in `bounce.laws`."
    )
    return "# Every name\n\n" + intro + "\n\n" + "\n\n".join(lists) + "\n"


def returned_types() -> list[str]:
    """What questions about a point return, and the top level does not name."""
    names = [n for n in ns.local.__all__ if n not in ns.__all__]
    return [n for n in names if inspect.isclass(getattr(ns.local, n))]


def _own(package: ModuleType) -> list[str]:
    """Documented names that a package or module offers."""
    listed = getattr(package, "__all__", None)
    names = listed or [n for n, t in vars(package).items() if _from(t, package)]
    return sorted(n for n in names if _documented(getattr(package, n)))


def _from(thing: object, module: ModuleType) -> bool:
    return _documented(thing) and getattr(thing, "__module__", "") == module.__name__


def _words(package: ModuleType) -> str:
    """The docstring of a module without its examples."""
    text = (inspect.getdoc(package) or "").partition("\n\nExamples\n")[0]
    return text.replace("``", "`")


def _page(title: str, about: str, path: str, names: Iterable[str]) -> str:
    return f"# {title}\n\n{about}\n\n" + _members(path, names)


def _members(path: str, names: Iterable[str]) -> str:
    return "\n".join(f"::: {path}.{name}\n{_OPTIONS.get(name, '')}" for name in names)


#: The class that a reader sees has the methods of what it is built on.
_OPTIONS = {"FilippovSystem": "    options:\n      inherited_members: true\n"}


def _floor(package: ModuleType, name: str) -> str:
    thing = getattr(package, name)
    if not _documented(thing):
        return ""
    return str(thing.__module__).removeprefix(package.__name__ + ".").partition(".")[0]


def _documented(thing: object) -> bool:
    return inspect.isclass(thing) or inspect.isfunction(thing)


def _draws(name: str, thing: object) -> bool:
    """Whether a name of a module is a public function that returns a picture."""
    public = inspect.isfunction(thing) and not name.startswith("_")
    return public and inspect.signature(thing).return_annotation == "Figure"


# Pages --------------------------------------------------------------------------------------------

PARTS: dict[str, Callable[[], str]] = {
    f.__name__: f
    for f in (
        decision_table,
        examples_of_classes,
        status_table,
        error_table,
        obligations,
        problems,
        regions,
        gallery,
    )
}

MARKER = re.compile(r"^<!-- generated: (\w+) -->$", re.MULTILINE)


def fill(markdown: str) -> str:
    """Replace each marker of a page by its part."""
    return MARKER.sub(lambda found: PARTS[found.group(1)](), markdown)
