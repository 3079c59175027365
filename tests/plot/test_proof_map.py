"""The map of a proof in pieces shows the classes where they are proven, and covers the ranges."""

import casadi as ca
import pytest

import nonsmooth as ns

x, y, z, m, q = (ca.SX.sym(s) for s in "xyzmq")
SYSTEM = ns.FilippovSystem(
    [x, y, z], surface=x, above=[-y, 1, -m], below=[z, -q, 1 + 0.1 * y], parameters={m: 2, q: 1}
)


def rectangles(figure):
    return [
        (p.get_x(), p.get_y(), p.get_width(), p.get_height(), p.get_facecolor())
        for p in figure.axes[0].patches
    ]


def test_pieces_have_the_colour_of_their_class_and_cover_the_ranges():
    """Delta = m q - 1 here: an invisible two-fold is II-C for m q > 1 and II-F for m q < 1."""
    fold = ns.find_two_fold(SYSTEM, near=[0, 0.1, -0.1])
    ranges = {"m": (0.5, 3), "q": (0.875, 1.125)}
    proof = ns.certify(fold, parameters=ranges, max_pieces=40)
    figure = ns.plot.proof_map(proof)
    found = rectangles(figure)
    assert len(found) == len(proof.pieces) > 4
    assert sum(w * h for *_, w, h, _ in found) == pytest.approx(2.5 * 0.25)
    colours = {
        p.label: c
        for p, c in zip(sorted_pieces(proof), (r[4] for r in found), strict=True)
        if p.proven
    }
    assert set(colours) == {"II-C", "II-F"} and colours["II-C"] != colours["II-F"]
    for a, c, w, h, colour in found:
        assert colour != colours["II-C"] or a * c > 1
        assert colour != colours["II-F"] or (a + w) * (c + h) < 1
    legend = [t.get_text() for t in figure.axes[0].get_legend().get_texts()]
    assert set(legend) == {"II-F", "II-C", "class undecided"}


def sorted_pieces(proof):
    return sorted(proof.pieces, key=lambda p: [p.parameters[k].ends[0] for k in "mq"])


def test_one_range_is_a_strip_and_one_piece_is_the_whole_of_it():
    fold = ns.find_two_fold(SYSTEM, near=[0, 0.1, -0.1])
    figure = ns.plot.proof_map(ns.certify(fold, parameters={"m": (2, 3)}), title="mine")
    assert [r[:4] for r in rectangles(figure)] == [(2, 0, 1, 1)]
    assert figure.axes[0].get_title() == "mine" and figure.axes[0].get_ylabel() == ""


@pytest.mark.parametrize("what", [3, "point"])
def test_what_has_no_range_is_refused(what):
    if what == "point":
        what = ns.certify(ns.find_two_fold(SYSTEM, near=[0, 0.1, -0.1]))
    with pytest.raises(ns.OptionError, match=r"proof.*ranges"):
        ns.plot.proof_map(what)


@pytest.mark.slow
def test_pieces_are_divided_along_what_the_class_depends_on():
    """Neither parameter moves the two-fold; pieces that stay undecided lie at m q = 1."""
    fold = ns.find_two_fold(SYSTEM, near=[0, 0.1, -0.1])
    proof = ns.certify(fold, parameters={"m": (0.5, 3), "q": (0.5, 1.5)}, max_pieces=64)
    undecided = 0.0
    for piece in proof.pieces:
        (a, b), (c, d) = ([float(v) for v in piece.parameters[k].ends] for k in "mq")
        if not piece.proven:
            undecided += (b - a) * (d - c) / 2.5
            slack = (b - a) * (d - c)  # of products of balls
            assert a * c - slack <= 1 <= b * d + slack
    assert undecided < 0.15
