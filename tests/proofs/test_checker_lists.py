"""The checker accepts saved lists, pieces of ranges, equilibria and orbits, and refuses altered ones."""

import json
from fractions import Fraction

import casadi as ca
import pytest

import nonsmooth as ns
from tests.proofs.checking import checked, run
from tests.proofs.systems import BALL, FOLD, drop, x, y, z

p, q = ca.SX.sym("p"), ca.SX.sym("q")
BOX = [(-1.5, 1.5), (-1.5, 1.5), (-1.0, 1.0)]
FLAT = [(-1.5, 1.5), (-1, 1)]


def altered(path, change):
    """Change the one record of a file, and check it again."""
    text = json.loads(path.read_text())
    change(text)
    path.write_text(json.dumps(text))
    code, words = run(path)
    return code == 1 and "NOT CHECKED" in words


def plane(above, below):
    return ns.FilippovSystem([x, y], surface=y, above=above, below=below)


def folds(first, second, **more):
    return ns.FilippovSystem(
        [x, y, z], surface=z + 0.1 * x * y, above=[1, 1, first], below=[1, -1, second], **more
    )


LISTS = [
    (folds(x**2 + y**2 - 1, x - y), BOX, "two-fold", {}),
    (
        folds(x**2 - p, y - x, parameters={p: 0.5}),
        BOX,
        "two-fold",
        {"parameters": {"p": (0.4, 0.6)}},
    ),
    (plane([1, x * (x**2 - 0.5)], [1, 1]), FLAT, "fold", {}),
    (plane([1, 1], [1 - x**2, y + x - 0.25]), FLAT, "equilibrium", {"side": "-"}),
    (plane([x**2 - 0.25, -1], [x**2 - 0.25, 1]), FLAT, "pseudo-equilibrium", {}),
    (folds(x**2 + y**2 - 1, x - 2), BOX, "two-fold", {}),
]


@pytest.mark.parametrize("k", range(len(LISTS)))
def test_complete_lists_are_checked_and_shortened_ones_are_not(k, tmp_path):
    system, box, kind, options = LISTS[k]
    found = ns.prove_all(system, box, kind, **options)
    path = tmp_path / "list.json"
    code, words = checked(found, path)
    assert found.complete and code == 0 and f"exactly {len(found.zeros)} points" in words, words
    if found.zeros:
        assert altered(path, lambda text: text["list"]["zeros"].pop())


def test_a_list_with_points_outside_its_box_is_refused(tmp_path):
    found = ns.prove_all(LISTS[3][0], [(-1.5, 1.5), (-1, 2)], "equilibrium", side="-")
    path = tmp_path / "list.json"
    found.save(path)

    def moved(text):
        text["list"]["zeros"] += text["list"].pop("others")
        text["list"]["others"] = []

    assert found.record["others"] and altered(path, moved)
    found.save(path)
    assert altered(path, lambda text: text["list"].update(bounds=[["-1.5", "0.5"], ["-1", "2"]]))
    found.save(path)
    assert altered(path, lambda text: text["list"].update(complete=False))


@pytest.mark.parametrize("sign", (1, -1))
def test_kinds_in_space_are_checked_by_counting_eigenvalues(sign, tmp_path):
    system = ns.FilippovSystem(
        [x, y, z],
        surface=z + 5,
        above=[y - 0.1 * x, -x - 0.1 * y + 0.2 * y**2, sign * (z - 1)],
        below=[1, 1, 1],
    )
    proof = ns.certify(ns.find_equilibrium(system, [0.1, 0.1, 0.9]), system=system)
    assert proof.label == ("real saddle" if sign > 0 else "real stable focus")
    path = tmp_path / "point.json"
    code, words = checked(proof, path)
    assert code == 0 and proof.label in words
    for label in ("real stable node", "virtual saddle", "real unstable focus"):
        proof.save(path)
        assert altered(path, lambda t, label=label: t["proofs"][0]["claims"].update(label=label))


@pytest.mark.slow
def test_planar_equilibria_and_cusps_are_checked(tmp_path):
    node = plane([y - x, 1 - 2 * y], [1, 1])
    slides = plane([1 - x, -1], [-1 - x, 1])
    cusp = ns.FilippovSystem([x, y, z], surface=x, above=[y + z**2, 0 * x, 1], below=[1, 0, 0])
    proofs = [
        ns.certify(ns.find_equilibrium(node, [1.0, 1.0]), system=node),
        ns.certify(ns.find_pseudo_equilibrium(slides, [0.1, 0.0]), system=slides),
        ns.prove_all(cusp, [(-1, 1), (-1, 1), 0], "fold").zeros[0],
    ]
    labels = ["real stable node", "real stable pseudo-node", "cusp"]
    for proof, label in zip(proofs, labels, strict=True):
        path = tmp_path / "point.json"
        code, words = checked(proof, path)
        assert proof.label == label and code == 0 and label in words, words
        other = "visible" if label == "cusp" else label.replace("stable", "unstable")
        assert altered(path, lambda t, other=other: t["proofs"][0]["claims"].update(label=other))


@pytest.mark.slow
def test_pieces_must_cover_the_ranges_of_parameters(tmp_path):
    system = ns.FilippovSystem(
        [x, y, z, q],
        surface=x,
        above=[-(y**3 + y - q * p), 1, -2, 0],
        below=[z, -1, 1, 0],
        parameters={p: 1.0},
    )
    fold = ns.find_two_fold(system, near=[0, 0.5, 0, 1.0], hold=["q"])
    proof = ns.certify(fold, hold={"q": (-1, 1)}, parameters={"p": (0.75, 1.25)})
    path = tmp_path / "pieces.json"
    code, words = checked(proof, path)
    assert proof.proven and len(proof.pieces) > 1 and code == 0 and "cover the ranges" in words
    assert altered(path, lambda t: t["proofs"].pop())
    proof.save(path)
    assert altered(path, lambda t: t["ranges"].__setitem__(0, ["1/2", "3"]))


def test_points_of_a_mode_are_checked_to_be_there(tmp_path):
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    system = ns.FilippovSystem(
        [x, y], surfaces=[y, x + 1], multipliers=[a, b], field=[x, -a + 0 * b]
    )
    found = ns.prove_all(system, [(-0.5, 0.5), (-1, 1)], "pseudo-equilibrium", mode="s+")
    path = tmp_path / "mode.json"
    code, _ = checked(found.zeros[0], path)
    assert code == 0

    def behind(text):
        graph = text["proofs"][0]["graph"]
        graph["nodes"].append(["neg", graph["positive"][0]])
        graph["positive"] = [len(graph["nodes"]) - 1]

    assert altered(path, behind)


def orbits():
    """A crossing, impacts, and resets with a stop that is passed the other way at first."""
    yield FOLD, [1, 0, 0], 3, "+ -"
    yield BALL, [1, 0], 3, "o"
    yield drop(ns.Stop(x - 0.75, 1, "high")), [1, 0], "1.25", "-"


@pytest.mark.slow_cases("0", "2")
@pytest.mark.parametrize("k", range(3))
def test_orbits_are_checked_and_altered_ones_are_refused(k, tmp_path):
    system, start, end, itinerary = list(orbits())[k]
    proof = ns.certify_orbit(system, start, end)
    path = tmp_path / "orbit.json"
    code, words = checked(proof, path)
    assert proof.proven and proof.itinerary == itinerary
    assert code == 0 and f"{len(proof.events)} events as claimed" in words, words

    def moved(text, what):
        low, high = (str(Fraction(v) + Fraction(1, 10**9)) for v in what(text))
        what(text)[:] = [low, high]

    for what in (
        lambda t: t["orbit"]["end"][0],
        lambda t: t["orbit"]["events"][0]["t"],
        lambda t: t["orbit"]["events"][0]["x"][0],
        lambda t: t["orbit"]["start"][0],
    ):
        proof.save(path)
        assert altered(path, lambda t, what=what: moved(t, what))
    for change in (
        lambda t: t["orbit"]["events"].pop(),
        lambda t: t["orbit"]["events"].append(t["orbit"]["events"][-1]),
        lambda t: t["orbit"].update(first="?"),
        lambda t: t["orbit"].update(status="elsewhere"),
        lambda t: t["orbit"].update(proven=False),
        lambda t: t["orbit"]["start"].__setitem__(0, ["0.9", "1.1"]),
    ):
        proof.save(path)
        assert altered(path, change)
