"""Every public name is on one page of the API, and all it takes, has, returns and raises is described."""

import dataclasses
import importlib
import inspect
import re
from collections import Counter
from pathlib import Path

import pytest

import bounce
import nonsmooth as ns
from docs.tools import api

DOCS = Path(__file__).parents[2] / "docs"
OBJECTS = dict(api.objects())
MODULES = sorted({path.rpartition(".")[0] for path in OBJECTS})
SECTION = re.compile(
    r"^(?:Other Parameters|Parameters|Attributes|Returns|Yields|Raises|Warns)\n-+\n(.*?)(?=^[A-Z][A-Za-z ]*\n-+$|\Z)",
    re.MULTILINE | re.DOTALL,
)


def undescribed(doc):
    """Entries of a docstring's lists (parameters, what is returned and raised) without a description."""
    bare = []
    for section in SECTION.findall(inspect.cleandoc(doc)):
        entries = re.split(r"^(?=\S)", section, flags=re.MULTILINE)
        bare += [e.strip() for e in entries if e.strip() and not e.partition("\n")[2].strip()]
    return bare


def docstrings(path, thing):
    """The docstring of an object and those of its public methods, properties included."""
    yield path, thing.__doc__
    if inspect.isclass(thing):
        for name, member in vars(thing).items():
            function = getattr(member, "fget", None) or getattr(member, "__func__", member)
            if not name.startswith("_") and inspect.isfunction(function) and function.__doc__:
                yield f"{path}.{name}", function.__doc__


def of(module):
    """The objects of a module, by their paths."""
    found = {path: thing for path, thing in OBJECTS.items() if path.rpartition(".")[0] == module}
    assert found
    return found.items()


@pytest.mark.parametrize("module", MODULES)
def test_every_parameter_attribute_result_and_error_is_described(module):
    missing = {
        where: bare
        for path, thing in of(module)
        for where, doc in docstrings(path, thing)
        if (bare := undescribed(doc))
    }
    assert missing == {}


def entries(doc):
    """Names that a docstring's lists have, or that its text says as ``name``."""
    said = set(re.findall(r"``(\w+)``", doc))
    heads = re.findall(
        r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: : .*)?$", inspect.cleandoc(doc), re.MULTILINE
    )
    return said | {name.strip(" *") for head in heads for name in head.split(",")}


def expected(path, thing):
    """Parameters of functions and methods, and fields of results; those of overrides are their base's."""
    if not inspect.isclass(thing):
        return [(path, thing.__doc__, [*inspect.signature(thing).parameters])]
    found = []
    if not issubclass(thing, Exception):
        fields = (
            [f.name for f in dataclasses.fields(thing)] if dataclasses.is_dataclass(thing) else []
        )
        fields += getattr(thing, "_fields", ())
        own = {
            n for base in thing.__mro__ for n, m in vars(base).items() if isinstance(m, property)
        }
        found = [
            (path, thing.__doc__, [f for f in fields if not f.startswith("_") and f not in own])
        ]
    for name, member in vars(thing).items():
        function = getattr(member, "__func__", member)
        inherited = any(name in vars(base) for base in thing.__mro__[1:])
        if not name.startswith("_") and inspect.isfunction(function) and not inherited:
            names = [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]
            found.append((f"{path}.{name}", function.__doc__, names))
    return found


@pytest.mark.parametrize("module", MODULES)
def test_no_parameter_and_no_field_is_left_out(module):
    missing = {
        where: [name for name in names if name not in entries(doc or "")]
        for path, thing in of(module)
        for where, doc, names in expected(path, thing)
    }
    assert {where: names for where, names in missing.items() if names} == {}


@pytest.mark.parametrize("module", [ns, bounce, bounce.golf, bounce.laws], ids=lambda m: m.__name__)
def test_every_public_name_is_on_a_page(module):
    names = [n for n in module.__all__ if api.documented(getattr(module, n))]
    assert names
    missing = [n for n in names if f"{module.__name__}.{n}" not in OBJECTS]
    assert missing == [], "add them to docs/tools/tasks.py"


def test_rooms_of_the_ball_are_there():
    for room in ("contact", "shot", "maps"):
        for name in getattr(bounce, room).__all__:
            assert f"bounce.{room}.{name}" in OBJECTS


def test_no_name_is_on_two_pages():
    counts = Counter(path for path, _ in api.objects())
    assert [path for path, n in counts.items() if n > 1] == []


def test_pages_request_each_name_and_are_in_the_navigation():
    pages = api.pages()
    text = "\n".join(t for uri, t in pages.items() if uri != "api/index.md")
    requested = re.findall(r"^(?:\[\]\(\)\{#([\w.]+)\}\n\n)?::: ([\w.]+)$", text, re.MULTILINE)
    assert sorted(shown or path for shown, path in requested) == sorted(OBJECTS)
    for shown, path in requested:  # a module of the same name would be described instead
        module, _, name = path.rpartition(".")
        thing = getattr(importlib.import_module(module), name)
        assert not inspect.ismodule(thing) and thing is OBJECTS[shown or path]
    assert len([shown for shown, _ in requested if shown]) > 20
    navigation = (DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8")
    assert [uri for uri in pages if f": {uri}\n" not in navigation] == []


def test_parameters_are_described_where_they_are_listed():
    """What the pages show in place of "As in" another function, and what is left of it."""
    shared = pytest.importorskip("docs.tools.shared_entries", reason="griffe is of the docs extra")

    def shown(thing):
        return shared.one_each(inspect.getdoc(thing) or "", thing.__module__)

    assert "\nt\n    Time, where the system depends on it.\nsurface\n" in shown(ns.classify)
    assert "mode`` chooses sides" in shown(ns.classify).partition("\nmode\n")[2]
    left = {
        path
        for path, thing in OBJECTS.items()
        if inspect.isfunction(thing)
        and "As in :func:" in "".join(shown(thing).partition("Returns\n---")[:1])
    }
    kept = {
        "bounce.lift_off",
        "bounce.maps.dividing_surface",
        "bounce.maps.proven_map",
        "nonsmooth.attractors",
    }
    assert left == kept
