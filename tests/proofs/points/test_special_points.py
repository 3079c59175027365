"""Special points are classified as in closed form."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, y, z, t = (ca.SX.sym(name) for name in "xyzt")
#: h = y, L1 = x^2 + z, L11 = 2 x, L111 = 2: folds along z = -x^2, a cusp at the origin.
CUSP = ns.FilippovSystem([x, y, z], surface=y, above=[1, x**2 + z, 0], below=[0, 1, 0])


def test_a_cusp_is_proven_where_the_second_derivative_is_zero_exactly():
    proof = ns.certify(ns.local.find_fold(CUSP, [0, 0, 0]), system=CUSP, hold=["x"])
    assert (proof.label, proof.proven) == ("cusp", True)


def test_pieces_that_hold_the_cusp_stay_undecided_and_the_others_are_folds():
    fold = ns.local.find_fold(CUSP, [0.5, 0, -0.25])
    proof = ns.certify(fold, system=CUSP, hold={"x": (-0.5, 0.5)}, max_pieces=4)
    assert not proof.proven and len(proof.pieces) == 4
    pieces = sorted(proof.pieces, key=lambda piece: piece.parameters["x"].ends[0])
    assert [piece.label for piece in pieces] == ["invisible", "", "", "visible"]


def test_a_fold_of_both_fields_does_not_claim_that_the_other_one_crosses():
    system = ns.FilippovSystem([x, y], surface=y, above=[1, x], below=[1, 2 * x])
    proof = ns.certify(ns.local.find_fold(system, [0.0, 0.0]), system=system)
    assert proof.label == "visible"
    assert "it may be tangent too" in str(proof)
    assert "begins at the fold" not in str(proof)


def test_a_virtual_pseudo_equilibrium_lies_in_crossing():
    """(1 + lam)/2 + 3 (1 - lam)/2 = 0 at lam = 2."""
    system = ns.FilippovSystem([x, y], surface=y, above=[-x, 1], below=[-x, 3])
    proof = ns.certify(ns.find_pseudo_equilibrium(system, [0.0, 0.0]), system=system)
    assert (proof.label, proof.proven) == ("virtual stable pseudo-node", True)
    assert "It lies in crossing." in str(proof)
    assert 2 in proof.point["lambda"]


def test_equilibria_of_a_field_that_depends_on_time_are_refused():
    frozen = ns.FilippovSystem([x, y], surface=y, above=[-x, -1 - y], below=[-x, 1])
    moving = ns.FilippovSystem(
        [x, y], surface=y, above=[-x, -1 - y + ca.sin(t)], below=[-x, 1], time=t
    )
    found = ns.find_pseudo_equilibrium(frozen, [0.0, 0.0])
    with pytest.raises(ns.DefinitionError, match="time"):
        ns.certify(found, system=moving)


def test_the_multiplier_of_hidden_dynamics_has_no_pseudo_equilibrium_that_could_be_proven():
    lam = ca.SX.sym("lam")
    linear = ns.FilippovSystem([x, y], surface=y, multipliers=lam, field=[-x, -lam])
    hidden = ns.FilippovSystem(
        [x, y], surface=y, multipliers=lam, field=[-x, -(lam**3)], hidden=True
    )
    found = ns.find_pseudo_equilibrium(linear, [0.0, 0.0])
    with pytest.raises(ns.DefinitionError, match="linearly"):
        ns.certify(found, system=hidden)


@pytest.mark.parametrize("value", [object(), None, "1/0", "a", np.inf, True])
def test_what_is_no_number_is_refused_with_the_words_that_were_given(value):
    p = ca.SX.sym("p")
    system = ns.FilippovSystem(
        [x, y], surface=y, above=[-x, -1 - y], below=[-x, 1 + p], parameters={p: 1.0}
    )
    found = ns.find_pseudo_equilibrium(system, [0.0, 0.0])
    with pytest.raises(ns.NonsmoothError, match="p"):
        ns.certify(found, system=system, parameters={"p": value})


def test_a_point_without_its_system_needs_one():
    with pytest.raises(ns.OptionError, match="system"):
        ns.certify(ns.local.find_fold(CUSP, [0, 0, 0]))
