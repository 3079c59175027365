"""The checker accepts saved proofs of special points and refuses altered ones."""

import ast
import json
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from tests.proofs.checking import CHECKER, checked, run, run_records
from tests.proofs.systems import PLANE, TEIXEIRA, TRANSCENDENTAL, x, y, z

PROOF = ns.certify(ns.find_two_fold(TRANSCENDENTAL, near=(0.257, -0.62, 0.016)), width=1e-30)


def test_the_checker_imports_nothing_of_the_prover():
    for path in CHECKER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) else []
            assert not {n.split(".")[0] for n in names} & {"nonsmooth", "flint", "casadi", "numpy"}


def test_proofs_of_every_kind_are_checked(tmp_path):
    mostly = ns.certify(ns.find_two_fold(TEIXEIRA, near=(0, 0.1, -0.1)))
    functions = ns.FilippovSystem(
        [x, y, z],
        surface=x,
        above=[ca.sqrt(1 + y) - ca.tanh(z) - 1, ca.atan2(1 + z, 2), ca.asinh(z) - 2],
        below=[z + y**3 / 3, -1, ca.erf(y) + ca.cosh(z) + (1 + y) ** 1.5],
    )
    many = ns.certify(ns.find_two_fold(functions, near=(0.0, 0.01, 0.01)))
    n, lam = z - 0.3 * y * y, ca.SX.sym("lam")
    f, g = [y, 1, -1], [1, 0.5, 0.25 * y]
    coulomb = ns.FilippovSystem(
        [x, y, z],
        surface=x,
        multipliers=lam,
        field=[a - lam * 0.7 * n * b for a, b in zip(f, g, strict=True)],
    )
    same = ns.certify(ns.find_two_fold(coulomb, near=(0.0, 0.1, 0.1)))
    fold = ns.certify(ns.local.find_fold(PLANE, [1.4, 0.0]), system=PLANE)
    for proof in (PROOF, mostly, many, same, fold):
        assert proof.proven, proof
        code, words = checked(proof, tmp_path / "proof.json")
        assert code == 0 and "checked: exactly one" in words, words
        assert "class" in words or "visible" in words
    assert "F1 = F2" in str(same)


def altered(record):
    """False statements made of a true one."""
    yield "label", {**record, "claims": {**record["claims"], "label": "VV-F"}}
    shifted = [[str(1 + float.fromhex("0x1p-1")), "2"], *record["box"][1:]]
    yield "box", {**record, "box": shifted}
    wide = [["-9", "9"]] * len(record["box"])
    yield "a box with more than is proven", {**record, "box": wide}
    singular = [["0"] * len(row) for row in record["matrix"]]
    yield "matrix", {**record, "matrix": singular}
    moved = [[str(Fraction(v) + Fraction(1, 10**25)) for v in pair] for pair in record["point"]]
    yield "point", {**record, "point": moved}
    nodes = [
        ["const", "1/11"] if n[:1] == ["const"] and n[1] == str(Fraction(0.1)) else n
        for n in record["graph"]["nodes"]
    ]
    yield "graph", {**record, "graph": {**record["graph"], "nodes": nodes}}
    yield "coincident fields", {**record, "claims": {**record["claims"], "coincident": True}}


@pytest.mark.parametrize("k", range(7))
def test_false_statements_are_not_checked(k, tmp_path):
    what, false = list(altered(json.loads(json.dumps(PROOF.record))))[k]
    code, words = run_records([false], tmp_path)
    assert code == 1 and "NOT CHECKED" in words, (what, words)


@pytest.mark.slow
def test_every_two_fold_of_random_systems_is_checked(tmp_path):
    """Boxes of uniqueness are a little inside the limit: the checker's intervals are wider."""
    rng = np.random.default_rng(77)
    monomials = [1, x, y, z, x**2, y**2, x * y, x**3, y**3, x * y**2, z * x]
    records = []
    for _ in range(20):
        first, second = (
            sum(float(c) * m for c, m in zip(rng.normal(size=11), monomials, strict=True))
            for _ in "ab"
        )
        system = ns.FilippovSystem([x, y, z], surface=z, above=[1, 1, first], below=[1, -1, second])
        found = ns.prove_all(system, [(-1.5, 1.5), (-1.5, 1.5), (-1, 1)])
        records += [p.record for p in found.zeros if p.proven]
    code, words = run_records(records, tmp_path)
    assert len(records) > 10 and code == 0, words


def deep(record):
    nodes = record["graph"]["nodes"]
    for k in range(len(nodes), len(nodes) + 20_000):
        nodes.append(["sin", k - 1])


CRAFTED = {
    "a number that fills the memory": lambda r: r["box"][0].__setitem__(0, "1e999999999"),
    "a fraction over zero": lambda r: r["box"][0].__setitem__(0, "1/0"),
    "an interval with its ends exchanged": lambda r: r["box"][0].reverse(),
    "nested instructions": deep,
    "a later argument": lambda r: r["graph"]["nodes"].insert(0, ["neg", 0]),
    "an argument from the end": lambda r: r["graph"]["nodes"].append(["neg", -1]),
    "an exponent": lambda r: r["graph"]["nodes"].append(["power", 0, 10**9]),
    "powers of powers": lambda r: r["graph"]["nodes"].extend(
        [["const", "3"], *(["sq", len(r["graph"]["nodes"]) + k] for k in range(60))]
    ),
    "an operation": lambda r: r["graph"]["nodes"].append(["fabs", 0]),
    "an output": lambda r: r["graph"].update(surface=-1),
    "states": lambda r: r.update(states=10**9),
    "an unknown twice": lambda r: r["unknowns"].__setitem__(0, r["unknowns"][1]),
    "a kind": lambda r: r.update(kind="lie"),
    "a side": lambda r: r.update(side=""),
}


@pytest.mark.parametrize("what", CRAFTED)
def test_crafted_records_are_refused_in_words(what, tmp_path):
    record = json.loads(json.dumps(PROOF.record))
    CRAFTED[what](record)
    code, words = run_records([record], tmp_path)
    assert code == 1 and "NOT CHECKED: CheckError" in words and "Traceback" not in words, words


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "{}", '{"proofs": 3}', "[" * 10**5, "\udcff"])
def test_files_that_claim_nothing_are_refused(text, tmp_path):
    path = tmp_path / "none.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    for name in (path, tmp_path / "missing", tmp_path, "/dev/zero"):
        code, words = run(name)
        assert code == 1 and "NOT CHECKED" in words and "Traceback" not in words, words
