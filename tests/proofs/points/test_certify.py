"""Theorems about special points agree with closed forms and mpmath; false ones are not proven."""

import subprocess
import sys

import casadi as ca
import mpmath
import numpy as np
import pytest

import nonsmooth as ns
from tests.proofs.systems import PLANE, TEIXEIRA, TRANSCENDENTAL, x, y, z


def flat(above, below, **more):
    return ns.FilippovSystem([x, y, z], surface=x, above=above, below=below, **more)


def proven(system, near=(0.0, 0.1, -0.1), **options):
    return ns.certify(ns.find_two_fold(system, near=near), **options)


def test_the_teixeira_singularity_is_proven_exactly():
    proof = proven(TEIXEIRA, width=1e-30)
    assert proof.proven and proof.label == "II-C" and proof.bits <= 256
    assert all(v.exact and v.low == "0" for v in proof.point.values())
    assert proof.values["nu1"].low == proof.values["nu1"].high == "-2"
    with mpmath.workdps(60):
        for name, sign in (("eigenvalue_low", -1), ("eigenvalue_high", 1)):
            reference = (-3 + sign * mpmath.sqrt(5)) / 2
            value = proof.values[name]
            assert mpmath.mpf(value.low) <= reference <= mpmath.mpf(value.high)
            assert value.radius < 1e-30
    assert "exactly one two-fold" in str(proof) and "infinitely many" in str(proof)


@pytest.mark.parametrize(
    ("above", "below", "label"),
    [
        ([-y, -1, 1], [z, 2, -1], "VV-F"),
        ([-y, 1, -2], [z, -0.5, 1], "boundary Delta=0: II-C|II-F"),
        ([-y, 1, -2], [z, -0.5 - 1e-9, 1], "II-C"),
        ([-y, 1, -2], [z, -0.5 + 1e-9, 1], "II-F"),
    ],
)
def test_classes_beside_a_boundary_are_distinct(above, below, label):
    proof = proven(flat(above, below), near=(0.0, 0.0, 0.0))
    assert proof.proven and proof.label == label


@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_classes_are_those_of_the_table(signs):
    rng = np.random.default_rng(7)
    for nu1, nu2 in rng.uniform(-3, 3, size=(8, 2)):
        s1, s2 = signs
        # z1 > 0: (-z2, -sigma1, nu1), z1 < 0: (z3, nu2, sigma2)
        system = flat([-y, -s1, nu1], [z, nu2, s2])
        proof = proven(system, near=(0.0, 0.0, 0.0))
        table = ns.two_folds.classify_two_fold(signs, (nu1, nu2))
        assert proof.proven and proof.label == table.label
        for name, reference in (("nu1", nu1), ("nu2", nu2)):
            assert float(proof.values[name].low) <= reference <= float(proof.values[name].high)


def test_a_transcendental_two_fold_agrees_with_mpmath():
    proof = proven(TRANSCENDENTAL, near=(0.257, -0.62, 0.016), width=1e-40)
    m = mpmath.mp
    a, b, c, d = (m.mpf(v) for v in (0.1, 0.4, 0.6, 0.2))

    def equations(x, y, z):
        e = m.mpf(0.3)
        g = (a * y * m.cos(x * y), a * x * m.cos(x * y), 1)
        f1 = (1 + m.exp(-y), m.cos(z) - b, m.sin(2 * x) + m.exp(y) / 2 - c)
        f2 = (-1 + d * x, 1 + y * y, m.atan(x - e) + m.log(1 + y * y + x * x) + d * y - e)
        dot = lambda f: sum(u * v for u, v in zip(f, g, strict=True))
        return z + a * m.sin(x * y), dot(f1), dot(f2)

    with m.workdps(100):
        a, b, c, d = (m.mpf(v) for v in (0.1, 0.4, 0.6, 0.2))
        root = m.findroot(equations, (0.257, -0.62, 0.016))
        for value, reference in zip(proof.point.values(), root, strict=True):
            assert value.radius < 1e-40
            assert m.mpf(value.low) <= reference <= m.mpf(value.high)


def test_folded_constants_do_not_make_a_false_theorem():
    """Two-fold of a graph whose derivatives CasADi folds: y is a root of L2 = 0 over the doubles."""
    q = ca.SX.sym("q")
    system = ns.FilippovSystem(
        [x, y, z, q], surface=x, above=[-y, 1, -2, 0], below=[0.1 * (0.3 * z * z) - z, -1, 1, 0]
    )
    # L2 = 0 at z = 0 and z = 1/(a b), L22 = (2 a b z - 1): at the second zero exactly 1 times 1.
    fold = ns.find_two_fold(system, near=[0, 0, 33.0, 0], hold=["q"])
    proof = ns.certify(fold, hold=["q"], width=1e-40)
    from fractions import Fraction

    reference = 1 / (Fraction(0.1) * Fraction(0.3))
    assert proof.proven and reference in proof.point["z"]
    folded = 1 / Fraction(0.1 * 0.3)
    assert folded not in proof.point["z"]


def test_written_constants_are_decimals():
    system = flat([-(y - 0.1), 1, -2], [z, -1, 1])
    assert "1/10" in proven(system, numbers="written").point["y"]
    assert "1/10" not in proven(system, numbers="stored", width=1e-25).point["y"]


def test_double_and_missing_two_folds_are_not_proven():
    double = flat([-(y * y) + 1e-30 * z, 1, -2], [z, -1, 1])
    fold = ns.find_two_fold(TEIXEIRA, near=[0, 0.1, -0.1])
    lookalike = object.__new__(type(fold))
    for miss in (double, flat([-(y * y) - 1e-9, 1, -2], [z, -1, 1])):
        lookalike.__dict__.update(fold.__dict__, system=miss)
        proof = ns.certify(lookalike)
        assert not proof.proven and not proof.exists and "No proof" in str(proof)


def test_parameters_may_be_intervals():
    p = ca.SX.sym("p")
    system = flat([-(y - p), 1, -2], [z, -1, 1], parameters={p: 0.3})
    proof = proven(system, parameters={"p": (0.29, 0.31)})
    assert proof.proven and proof.label == "II-C"
    assert 0.29 in proof.point["y"] and 0.31 in proof.point["y"]
    assert not any(proof.point["y"].ends[0] > 0.3 for _ in "x")


@pytest.mark.parametrize("held", [False, True])
def test_wide_parameters_and_held_states_are_divided_and_the_parts_named(held):
    """nu1 = -p, nu2 = -1: II-C for p > 1, II-F for p < 1."""
    p = ca.SX.sym("p")
    if held:
        system = ns.FilippovSystem(
            [x, y, z, p], surface=x, above=[-y, 1, -p, 0], below=[z, -1, 1, 0]
        )
        fold = ns.find_two_fold(system, near=[0, 0.1, -0.1, 2.0], hold=["p"])
        proof = ns.certify(fold, hold={"p": ("0.3", "3.1")}, max_pieces=24)
    else:
        system = flat([-y, 1, -p], [z, -1, 1], parameters={p: 2.0})
        proof = proven(system, parameters={"p": (0.5, 3.0)}, max_pieces=24)
        assert proof.exists and proven(system, parameters={"p": ("1.125", "3")}).proven
    assert not proof.proven and len(proof.pieces) > 4
    for piece in proof.pieces:
        low, high = piece.parameters["p"].ends
        if piece.proven:
            assert piece.label == ("II-C" if low > 1 else "II-F")
        else:
            assert low <= 1 <= high


def test_coincident_fields_are_proven_by_algebra():
    n = z - 0.3 * y * y
    f = [y, 1, -1]
    g = [1, 0.5, 0.25 * y]
    lam = ca.SX.sym("lam")
    system = ns.FilippovSystem(
        [x, y, z], surface=x, multipliers=lam, field=[f[i] - lam * 0.7 * n * g[i] for i in range(3)]
    )
    proof = proven(system)
    assert proof.proven and "F1 = F2 there" in str(proof)
    assert proof.values["Delta"].low == proof.values["Delta"].high == "0"
    assert proof.label in ("VV-C1", "II-F", "mix-0")


def test_folds_equilibria_and_pseudo_equilibria():
    fold = ns.local.find_fold(PLANE, [1.4, 0.0])
    proof = ns.certify(fold, system=PLANE, width=1e-25)
    assert proof.label == "invisible" and proof.point["x"].radius < 1e-25
    s = ns.FilippovSystem([x, y], surface=y, above=[y - x, 1 - 2 * y], below=[1, 1])
    proof = ns.certify(ns.find_equilibrium(s, [1.0, 1.0]), system=s)
    assert proof.label == "real stable node" and proof.point["x"].low == "0.5"
    s = ns.FilippovSystem([x, y], surface=y, above=[1 - x, -1], below=[-1 - x, 1])
    found = ns.find_pseudo_equilibrium(s, [0.1, 0.0])
    proof = ns.certify(found, system=s)
    assert proof.label == "real stable pseudo-node" and "attracting sliding" in str(proof)


def test_more_states_than_equations_need_a_plane_or_held_states():
    q = ca.SX.sym("q")
    system = ns.FilippovSystem(
        [x, y, z, q], surface=x, above=[-y + q * q, 1, -2, 0.1], below=[z, -1, 1, 0.3]
    )
    fold = ns.find_two_fold(system, near=[0, 0.1, -0.1, 0.2])
    proof = ns.certify(fold)
    assert proof.proven and "plane through" in str(proof)
    held = ns.certify(fold, hold=["q"])
    assert held.proven and "with q =" in str(held)


def test_what_is_given_wrongly_is_refused():
    fold = ns.find_two_fold(TEIXEIRA, near=[0, 0.1, -0.1])
    with pytest.raises(ns.OptionError, match="TwoFold"):
        ns.certify(TEIXEIRA)
    with pytest.raises(ns.OptionError, match="width"):
        ns.certify(fold, width=0.0)
    with pytest.raises(ns.OptionError, match="numbers"):
        ns.certify(fold, numbers="exact")
    with pytest.raises(ns.ParameterError, match="mu"):
        ns.certify(fold, parameters={"mu": 0.3})
    p = ca.SX.sym("p")
    system = flat([-(y - p), 1, -2], [z, -1, 1], parameters={p: 0.3})
    for bad in ((0.31, 0.29), (0.1, 0.2, 0.3), (0.1, np.inf), "much"):
        with pytest.raises(ns.NonsmoothError, match="p"):
            proven(system, parameters={"p": bad})


@pytest.mark.slow
def test_without_the_package_the_error_says_what_to_install():
    code = (
        "import sys; sys.modules['flint'] = None\n"
        "import nonsmooth as ns\n"
        "from nonsmooth import *\n"
        "try: ns.certify(None)\n"
        "except ns.proofs.MissingError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "python-flint" in done.stdout and "nonsmooth-dynamics[proofs]" in done.stdout


def test_held_states_may_be_intervals():
    q = ca.SX.sym("q")
    system = ns.FilippovSystem(
        [x, y, z, q], surface=x, above=[-y + q, 1, -2, 0], below=[z, -1, 1, 0]
    )
    fold = ns.find_two_fold(system, near=[0, 0.1, -0.1, 0.5], hold=["q"])
    proof = ns.certify(fold, hold={"q": (0.25, 0.75)})
    assert proof.proven and "For q in [0.25, 0.75]" in str(proof).replace("\n ", "")
    assert 0.25 in proof.point["y"] and 0.75 in proof.point["y"]
    with pytest.raises(ns.OptionError, match="hold of 'q'"):
        ns.certify(fold, hold={"q": (0.75, 0.25)})
