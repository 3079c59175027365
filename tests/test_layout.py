"""The layout of the project holds: no word of the client in nonsmooth, no trace of a machine, every
public name documented, no function longer than a screen, nothing private used elsewhere."""

import ast
import importlib
import inspect
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LONGEST_FUNCTION = 60  # lines, from `def` to its last, the docstring not counted

# Words of the client. The bouncing ball is also a classic of the general theory (impacts that
# accumulate), so nonsmooth/textbook may say those two words, and no others.
CLASSIC_WORDS = r"balls?|bounc(?:e|es|ed|ing|y)"
CLIENT_WORDS = rf"{CLASSIC_WORDS}|turf|golf\w*|lift[-_ ]?offs?"


def word_pattern(words):
    """Match any of the words, also as a part of a snake_case name."""
    return re.compile(rf"(?<![a-z])(?:{words})(?![a-z])", re.IGNORECASE)


# Spelled in pieces, so that this file does not match itself.
TRACES = re.compile(
    r"(?:^|[\s\"'`(=:,])/(?:" + "wo" + "rk|ro" + "ot|ho" + "me|Us" + "ers)/"
    r"|index" + r"[-_]url|find" + r"[-_]links"
    r"|python" + r"hosted\.org|py" + r"pi\.org/simple|registry" + r"\.npm"
)


def tracked_files():
    """The files of the project: git's list, or in an unpacked archive every file that is kept."""
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
        ).stdout
        paths = [ROOT / name for name in listed.split("\0") if name]
    except (OSError, subprocess.CalledProcessError):
        made = re.compile(r"^(?:\..*|build|dist|__pycache__|.*\.egg-info)$")
        paths = [p for p in ROOT.rglob("*") if not any(map(made.match, p.relative_to(ROOT).parts))]
    return [path for path in paths if path.is_file()]


def lines_matching(pattern, paths):
    """Return 'file:line: text' of every line of the text files that the pattern matches."""
    found = []
    for path in paths:
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a picture
        for number, line in enumerate(text.splitlines(), 1):
            if pattern.search(line):
                found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()[:100]}")
    return found


def sources(*folders, suffixes=(".py",)):
    """The source files under the folders, in order."""
    return sorted(p for f in folders for p in (ROOT / f).rglob("*") if p.suffix in suffixes)


@cache
def nodes(path):
    """Functions, imports and attributes in the syntax of a source file; the rest is not kept."""
    kept = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Import, ast.ImportFrom, ast.Attribute)
    found, rest = [], [ast.parse(path.read_text(encoding="utf-8"))]
    for node in rest:  # breadth first, as ast.walk does in twice the time
        if isinstance(node, kept):
            found.append(node)
        for value in vars(node).values():
            if isinstance(value, ast.AST):
                rest.append(value)
            elif isinstance(value, list):
                rest.extend(item for item in value if isinstance(item, ast.AST))
    return found


def test_nonsmooth_has_no_words_of_the_ball():
    textbook = ROOT / "nonsmooth" / "textbook"
    files = sources("nonsmooth", suffixes=(".py", ".c", ".h"))
    assert files
    general = [path for path in files if textbook not in path.parents]
    classic = [path for path in files if textbook in path.parents]
    beyond_classic = CLIENT_WORDS.removeprefix(CLASSIC_WORDS + "|")
    found = lines_matching(word_pattern(CLIENT_WORDS), general)
    found += lines_matching(word_pattern(beyond_classic), classic)
    assert not found, "\n".join(found)


def test_no_tracked_line_names_a_machine_or_a_registry():
    files = tracked_files()
    assert files
    found = lines_matching(TRACES, files)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("package", ["nonsmooth", "bounce", "bounce.golf", "bounce.laws"])
def test_every_public_name_is_documented(package):
    module = importlib.import_module(package)
    assert inspect.getdoc(module)
    assert list(module.__all__)
    missing = [m for name in module.__all__ for m in undocumented(name, getattr(module, name))]
    assert not missing, f"{package}: " + "; ".join(missing)


def undocumented(name, thing):
    """Return what the documentation of one public name lacks."""
    if isinstance(thing, (str, int, float)):
        return []  # __version__ and other constants
    doc = inspect.getdoc(thing) or ""
    if not doc.strip():
        return [f"{name} has no docstring"]
    if not inspect.isfunction(inspect.unwrap(thing)):
        return []
    signature = inspect.signature(thing)
    expected = ["Parameters"] if signature.parameters else []
    expected += [] if signature.return_annotation in (None, "None") else ["Returns"]
    sections = [s for s in expected if not re.search(rf"^{s}\n-{{{len(s)}}}$", doc, re.MULTILINE)]
    return [f"{name} has no {section} section" for section in sections]


def test_no_function_is_longer_than_a_screen():
    long = []
    for path in sources("nonsmooth", "bounce", "papers"):
        for node in nodes(path):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                lines = node.end_lineno - node.lineno + 1
                if ast.get_docstring(node, clean=False) is not None:
                    lines -= node.body[0].end_lineno - node.body[0].lineno + 1
                if lines > LONGEST_FUNCTION:
                    long.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name}: {lines}")
    assert not long, "\n".join(long)


def is_private(name):
    return name.startswith("_") and not name.endswith("__")


def private_uses(nodes):
    """Names with an underscore that a module imports, or takes from a module that it imported."""
    modules = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            modules |= {(a.asname or a.name).split(".")[0] for a in node.names}
        if isinstance(node, ast.ImportFrom):
            modules |= {a.asname or a.name for a in node.names if a.name.islower()}
            parts = [*(node.module or "").split("."), *(a.name for a in node.names)]
            yield from ((node.lineno, name) for name in parts if is_private(name))
        if isinstance(node, ast.Attribute) and is_private(node.attr):
            if isinstance(node.value, ast.Name) and node.value.id in modules - {"sys", "os"}:
                yield node.lineno, f"{node.value.id}.{node.attr}"


def test_nothing_private_is_used_in_another_module():
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in sources("nonsmooth", "bounce", "papers", "benchmarks", "docs")
        for line, name in private_uses(nodes(path))
    ]
    assert not found, "\n".join(found)
