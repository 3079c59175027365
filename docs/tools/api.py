"""Pages of the API by task: every public name of both packages, on one page each."""

from __future__ import annotations

import inspect
import pkgutil
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from operator import attrgetter
from types import ModuleType
from typing import Any

import bounce
import nonsmooth as ns

from .markdown_table import first_line, table
from .tasks import ERRORS, GOLF, TASKS, Task

PACKAGES = {
    "nonsmooth": ns,
    "nonsmooth.orbit": ns.orbit,
    "nonsmooth.proofs": ns.proofs,
    "bounce": bounce,
    "bounce.golf": bounce.golf,
}

#: Whole modules that are a page each: file name, module, title.
MODULES = (
    ("two_folds", ns.two_folds, "The algebra of two-folds"),
    ("continuation", ns.continuation, "Follow any curve"),
    ("plot", ns.plot, "Draw"),
    ("style", ns.plot.style, "Draw in the same style"),
    ("textbook", ns.textbook, "Problems with known answers"),
    ("bounce_laws", bounce.laws, "Laws in closed form"),
    ("bounce_plot", bounce.plot, "Draw bounces"),
)


def pages() -> dict[str, str]:
    """Return the pages of the API: every public name of both packages, by task."""
    found = {"api/index.md": overview()}
    for key, task in {**TASKS, **GOLF}.items():
        found[f"api/{key}.md"] = page(task.title, task.about, task.package, task.names)
    found["api/points.md"] += "\n## What the answers are\n\n" + members(
        "nonsmooth.local", returned_types()
    )
    for key, module, title in MODULES:
        found[f"api/{key}.md"] = page(title, words(module), module.__name__, own(module))
    found["api/errors.md"] = "# Errors and warnings\n\n" + _ERRORS + "\n\n"
    for path in ERRORS:
        found["api/errors.md"] += members(path, errors(path))
    return found


_ERRORS = (
    "A request that makes no sense raises an exception that says what was expected, what came and what "
    "to do. How runs end is not an error: that is their [status](../statuses.md)."
)


def listed() -> dict[str, Task]:
    """Every page made from a list of names."""
    return {**TASKS, **GOLF}


def errors(path: str) -> list[str]:
    """Exceptions and warnings that a package names."""
    module = PACKAGES[path]
    things = {n: getattr(module, n) for n in module.__all__}
    return [n for n, t in things.items() if inspect.isclass(t) and issubclass(t, Exception)]


def overview() -> str:
    """A table of every name, by page, with what it is."""
    lists = []
    for key, task in listed().items():
        lists.append(_rows(f"[{task.title}]({key}.md)", task.package, task.names))
        if key == "points":
            lists.append(
                _rows(f"[What the answers are]({key}.md)", "nonsmooth.local", returned_types())
            )
    for key, module, title in MODULES:
        lists.append(_rows(f"[{title}]({key}.md)", module.__name__, own(module)))
    for path in ERRORS:
        lists.append(_rows(f"[Errors of `{path}`](errors.md)", path, errors(path)))
    return "# Every name\n\n" + _INTRODUCTION + "\n\n" + "\n\n".join(lists) + "\n"


_INTRODUCTION = (
    "What most programs use is `nonsmooth.name` or `bounce.name`. "
    "Analysis at one point is in `nonsmooth.local`, parts of runs in `nonsmooth.flow`, orbits and their results "
    "in `nonsmooth.orbit`, proofs in `nonsmooth.proofs`. "
    "The algebra of two-folds, which needs no system, is in `nonsmooth.two_folds`; "
    "`nonsmooth.continuation` follows curves of any equations. "
    "More contact models and the friction laws are in `bounce.contact`, what one "
    "bounce returns is in `bounce.shot`, what many return in `bounce.maps`, laws in closed form are in "
    "`bounce.laws`, and `bounce.golf` is about golf balls from launch to rest."
)


def _rows(title: str, path: str, names: Iterable[str]) -> str:
    module = sys.modules[path]
    rows = [(f"[`{n}`][{place(path, n)}]", first_line(attrgetter(n)(module))) for n in names]
    return f"## {title}\n\n" + table(("name", "what it is"), rows)


def returned_types() -> list[str]:
    """Types that functions about a point return, and that no page lists by name."""
    shown = {n.removeprefix("local.") for task in TASKS.values() for n in task.names}
    names = [n for n in ns.local.__all__ if n not in shown]
    return [n for n in names if inspect.isclass(getattr(ns.local, n))]


def own(package: ModuleType) -> list[str]:
    """Documented names that a package or module offers."""
    if package is bounce.plot:
        return sorted(n for n, thing in vars(package).items() if _draws(n, thing))
    offered = getattr(package, "__all__", None)
    names = offered or [n for n, t in vars(package).items() if _from(t, package)]
    return sorted(n for n in names if documented(getattr(package, n)))


def objects() -> Iterator[tuple[str, object]]:
    """Every object that a page describes, by its path."""
    groups = [(task.package, task.names) for task in listed().values()]
    groups += [("nonsmooth.local", tuple(returned_types()))]
    groups += [(module.__name__, tuple(own(module))) for _, module, _ in MODULES]
    groups += [(path, tuple(errors(path))) for path in ERRORS]
    for path, names in groups:
        for name in names:
            yield f"{path}.{name}", attrgetter(name)(sys.modules[path])


def _from(thing: object, module: ModuleType) -> bool:
    return documented(thing) and getattr(thing, "__module__", "") == module.__name__


def words(package: ModuleType) -> str:
    """The docstring of a module without its examples."""
    text = (inspect.getdoc(package) or "").partition("\n\nExamples\n")[0]
    return text.replace("``", "`")


def page(title: str, about: str, path: str, names: Iterable[str]) -> str:
    """A page: a title, a paragraph, and the names to be described."""
    return f"# {title}\n\n{about}\n\n" + members(path, names)


def members(path: str, names: Iterable[str]) -> str:
    """Ask mkdocstrings for the description of each name."""
    return "\n".join(_member(path, name) for name in names)


def _member(path: str, name: str) -> str:
    """The entry of a name; where a module has the same name, by the path of its definition."""
    defined, shown = place(path, name), f"{path}.{name}"
    if defined == shown:
        return f"::: {defined}\n{_OPTIONS.get(name, '')}"
    label = name.rpartition(".")[2]
    options = f"    options:\n      heading: {shown}\n      toc_label: {label}\n"
    return f"[](){{#{shown}}}\n\n::: {defined}\n{options}"


def place(path: str, name: str) -> str:
    """By which path mkdocstrings finds a name."""
    if name.rpartition(".")[2] not in _module_names():
        return f"{path}.{name}"
    thing: Any = inspect.unwrap(attrgetter(name)(sys.modules[path]))
    return f"{thing.__module__}.{thing.__qualname__}"


@cache
def _module_names() -> set[str]:
    """Names of modules: mkdocstrings reads sources, and takes the module where both have the name."""
    packages = [(ns.__path__, "nonsmooth."), (bounce.__path__, "bounce.")]
    found = [m.name for path, start in packages for m in pkgutil.walk_packages(path, start)]
    return {name.rpartition(".")[2] for name in found}


#: The class that a reader sees has the methods of what it is built on.
_OPTIONS = dict.fromkeys(
    ("Ensemble", "FilippovSystem", "Trajectory"), "    options:\n      inherited_members: true\n"
)


def documented(thing: object) -> bool:
    """Whether a name is a class or function: what the pages describe."""
    return inspect.isclass(thing) or inspect.isfunction(thing)


def _draws(name: str, thing: object) -> bool:
    """Whether a name of a module is a public function that returns a picture."""
    public = inspect.isfunction(thing) and not name.startswith("_")
    return public and inspect.signature(thing).return_annotation == "Figure"
