"""What is no system, no work or no such law is refused in words, by whatever takes one."""

import casadi as ca
import pytest

import bounce
import nonsmooth as ns

X, Y, Z = (ca.SX.sym(s) for s in "xyz")
SPACE = ns.FilippovSystem(
    [X, Y, Z], surface=X, above=[-Y, 1, -2], below=[Z, -1, 1 + Y], parameters={ca.SX.sym("a"): 0.0}
)
SMOOTH = ns.FilippovSystem([X, Y], field=[Y, -X])


def test_a_smooth_system_has_no_sliding():
    with pytest.raises(ns.DefinitionError, match="switching surface"):
        ns.local.sliding_branches(SMOOTH, [0.0, 0.0])
    with pytest.raises(ns.DefinitionError, match="mode"):
        ns.orbit.saltation_matrix(SMOOTH, "+", "-", [0.0, 0.0])


def test_what_is_no_work():
    for call in (
        lambda: ns.ensemble(SMOOTH, [0.0, 0.0], t_end=1.0, work=2),
        lambda: ns.basins(SMOOTH, [[0.0, 0.0]], t_end=1.0, work=2),
    ):
        with pytest.raises(ns.OptionError, match=r"^work .*2"):
            call()


def test_how_constants_are_read():
    pytest.importorskip("flint")
    with pytest.raises(ns.OptionError, match="numbers"):
        ns.prove_all(SPACE, [(-1, 1)] * 3, numbers="exact")


def test_a_tilted_law_is_not_bounced_as_if_its_plane_were_level():
    law = bounce.laws.TURFS["natural"].law
    with pytest.raises(bounce.ModelError, match=r"law.*RigidBounce"):
        bounce.laws.rigid_lift_off_3d(law, [1.0, 0.0], -1.0, [0.2, 0.5])
