"""Damaged and crafted files of results: ``python -m tests.flow.damaged_files COUNT [SEED]`` reads that many.

A process of its own, since what is looked for may end it. It prints one line of counts and fails where reading a
file, or what is done with a result that was read, raises anything but the library's errors.
"""

import copy
import io
import json
import struct
import sys
import tempfile
import zipfile
from collections import Counter
from pathlib import Path

import casadi as ca
import numpy as np

import nonsmooth as ns

JUNK = (
    *(None, True, -1, 0, 1, 2, 7, 10**6, 2**31, 2**63, 10**40, 0.5, -1e308, np.nan, np.inf),
    *(
        "",
        "s",
        "+",
        "float64",
        "const",
        "mul",
        "\ud800",
        "\0",
        "x" * 5000,
        [],
        {},
        [[]],
        [None, -1],
    ),
    *({"array": ["float64", 0, [1]]}, {"array": ["float64", -1, [2]]}),
    *({"array": ["int32", 0, [2**40]]}, {"array": ["float64", 0, [2**40, 2**40]]}),
    *({"array": ["float64", 0, [0, 2**47]]}, {"system": 0}, {"system": -1}, {"tuple": [1]}),
    *({"of": "Event", "fields": {}}, {"mapping": [[[], 1]]}, {"status": 99}),
)


def originals():
    """Bytes of saved results: a run with resets and samples, one with contacts, an ensemble, a spectrum."""
    x, v, a, lam = (ca.SX.sym(s) for s in ("x", "v", "a", "lam"))
    block = ns.FilippovSystem.from_expression(
        [x, v],
        [v, -x - a * ca.sign(v - 0.3)],
        parameters={a: 0.4},
        resets=ns.Reset(x + 1, [x, -v], -1, "bumper"),
    )
    ball = ns.FilippovSystem(
        [x, v],
        field=[v, -1 - 0.1 * lam + 0.1 * ca.sin(x)],
        surface=v - x,
        multipliers=lam,
        impacts=ns.Impact(x, restitution=0.5),
        stops=ns.Stop(v - 9),
    )
    starts = np.array([[0.0, -2.0], [0.5, 0.5], [np.nan, 0.0]])
    results = [
        ns.simulate(block, [0.0, -2.0], 4.0, t_eval=[0.0, 1.0]),
        ns.simulate(ball, [1.0, 0.0], 1.5),
        ns.ensemble(block, starts, 2.0, at=ns.Section("h0", count=2)),
        ns.lyapunov_spectrum(ns.FilippovSystem([x], field=[-x]), [1.0], t_end=2.0),
    ]
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / str(k) for k in range(len(results))]
        for result, file in zip(results, files, strict=True):
            result.save(file)
        return [file.read_bytes() for file in files]


def parts_of(data):
    """Contents of an archive's members by name."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: bytearray(archive.read(name)) for name in archive.namelist()}


def archive_of(parts, method=zipfile.ZIP_DEFLATED):
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w") as archive:
        for name, content in parts.items():
            kept = zipfile.ZIP_STORED if name == "tree.npy" else method
            archive.writestr(name, bytes(content), kept)
    return memory.getvalue()


def row(content):
    memory = io.BytesIO()
    np.lib.format.write_array(memory, content, version=(1, 0))
    return bytearray(memory.getvalue())


# Kinds of damage: each takes a generator and the bytes of a file ---------------------------------


def flipped(rng, data):
    data = bytearray(data)
    for _ in range(rng.integers(1, 10)):
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
    return bytes(data)


def cut(rng, data):
    first, last = sorted(rng.integers(0, len(data), 2))
    return (data[:first], data[first:], data[:first] + data[last:], data[:last] + data[first:])[
        rng.integers(4)
    ]


def swapped(rng, data):
    parts = parts_of(data)
    names = list(parts)
    one, other = rng.choice(names, 2)
    parts[one], parts[other] = parts[other], parts[one]
    if rng.random() < 0.3:
        parts[str(rng.choice(["int64.npy", "object.npy", "../x.npy", "bool.npy"]))] = parts.pop(one)
    return archive_of(parts)


def altered(rng, data):
    """Bytes of a member, of its header or its content, in an archive that is intact."""
    parts = parts_of(data)
    content = parts[str(rng.choice(list(parts)))]
    most = min(128, len(content)) if rng.random() < 0.4 else len(content)
    for _ in range(rng.integers(1, 6)):
        content[rng.integers(most)] = rng.integers(256)
    return archive_of(
        parts, rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2])
    )


def sized(rng, data):
    """Sizes, methods and offsets in the directory of the archive."""
    data, at = bytearray(data), 0
    found = [at := data.find(b"PK\1\2", at + 1) for _ in range(len(parts_of(data)))]
    place = found[rng.integers(len(found))] + rng.choice([8, 10, 16, 20, 24, 28, 30, 42])
    data[place : place + 4] = struct.pack("<I", rng.choice([0, 1, 99, 2**20, 2**31, 2**32 - 1]))
    return bytes(data)


def _places(tree, found, where=()):
    found.append(where)
    pairs = (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    )
    for key, part in pairs:
        _places(part, found, (*where, key))
    return found


def _tree_of(parts):
    return json.loads(np.load(io.BytesIO(parts["tree.npy"])).tobytes())


def _with_tree(parts, text):
    parts["tree.npy"] = row(np.frombuffer(text.encode(), np.uint8))
    return archive_of(parts)


def replaced(rng, tree, junk=JUNK):
    """Change one part of a tree: another value, left out, doubled."""
    points = _places(tree, [])[1:]
    leaves = (
        [p for p in points if not any(q[:-1] == p for q in points)] if len(points) < 3000 else []
    )
    chosen = leaves if leaves and rng.random() < 0.5 else points
    if not chosen:
        return
    *road, last = chosen[rng.integers(len(chosen))]
    for key in road:
        tree = tree[key]
    new, choice = copy.deepcopy(junk[rng.integers(len(junk))]), rng.integers(4)
    if choice == 0 and isinstance(tree[last], (int, float)):
        new = type(tree[last])(tree[last] + int(rng.integers(-2, 3)))
    if choice == 1:
        del tree[last]
    elif choice == 2 and isinstance(tree, list):
        tree.insert(last, new)
    else:
        tree[last] = new


def retold(rng, data, within=None):
    """Some parts of the tree: other values, other shapes, left out, doubled, nested deeply."""
    parts = parts_of(data)
    tree = _tree_of(parts)
    for _ in range(rng.integers(1, 3)):
        replaced(rng, tree.get(within, tree))
    text = json.dumps(tree)
    if rng.random() < 0.05:
        text = text.replace(": ", ": " + "[" * 10**5, 1)
    return _with_tree(parts, text)


def rewired(rng, data):
    """Instructions of a system: operations, arguments, constants, outputs; names, shapes, events."""
    parts = parts_of(data)
    tree = _tree_of(parts)
    if not tree["systems"] or rng.random() < 0.3:
        return retold(rng, data, "systems" if tree["systems"] else None)
    graph = dict(tree["systems"][0]["mapping"])["graph"]["fields"]
    arrays = [v["array"] for v in graph.values() if "array" in v]
    operations = graph["operations"]["tuple"]
    for _ in range(rng.integers(1, 4)):
        kind, start, shape = arrays[rng.integers(len(arrays))]
        content, last = (
            np.load(io.BytesIO(parts[f"{kind}.npy"])).copy(),
            start + int(np.prod(shape)),
        )
        if last == start or rng.random() < 0.1:
            operations[rng.integers(len(operations))] = str(rng.choice(NAMES))
            continue
        old, place = content[start:last], rng.integers(start, last)
        wild = (-1, 2**31 - 1, -(2**31), int(old.max()) % 2**30 + 1)
        content[place] = wild[rng.integers(4)] if rng.random() < 0.1 else rng.choice(old)
        parts[f"{kind}.npy"] = row(content)
    return _with_tree(parts, json.dumps(tree))


NAMES = ("mul", "sin", "pow", "call", "fabs", "log", "input", "const", "div", "eq", "if_else_zero")
KINDS = (flipped, cut, swapped, altered, sized, retold, rewired, rewired)


def use(result):
    """What is done with a result that was read, also with one of another system."""
    repr(result), result._repr_html_() if hasattr(result, "_repr_html_") else None
    if not isinstance(result, ns.Trajectory):
        return
    system = result.system
    repr(system), system._repr_html_(), hash(system), result.itinerary
    result(np.linspace(result.t[0], result.t[-1], 7))
    ns.simulate(system, result.x[0], 0.05, parameters=result.parameters, max_steps=100)


def main(count, seed=0):
    rng, files, counts = np.random.default_rng(seed), originals(), Counter()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        for data in files:
            path.write_bytes(data)
            use(ns.load(path))
        for k in range(count):
            number, kind = rng.integers(len(files)), KINDS[k % len(KINDS)]
            path.write_bytes(kind(rng, files[number]))
            try:
                result = ns.load(path)
                result.save(path)
                again = path.read_bytes() == files[number]
                counts["read unchanged" if again else "read as another"] += 1
            except ns.OptionError:
                counts["refused"] += 1
                continue
            except BaseException:
                print(f"file {k} of kind {kind.__name__}, seed {seed}", file=sys.stderr)
                raise
            try:
                use(result)
            except ns.NonsmoothError:
                counts["refused in use"] += 1
            except BaseException:
                print(f"use of file {k} of kind {kind.__name__}, seed {seed}", file=sys.stderr)
                raise
    print(count, "files:", ", ".join(f"{name} {n}" for name, n in sorted(counts.items())))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
