"""Curves of pieces end where they close, are cut off or come to nothing; changes on a circle are found."""

from types import SimpleNamespace

import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.solvers.continuation.pieces import Departure, pieces


def label(turn):
    """+ on the half circle about ``turn`` + 90 degrees, - on the other."""
    return lambda angle: "a+" if np.sin(angle - turn) > 0 else "a-"


def sign(word):
    return 1 if word.endswith("+") else -1


@pytest.mark.parametrize("turn", [0.3, 2.0, -1.1])
def test_both_ends_of_a_half_circle_are_found_the_nearer_one_first(turn):
    ahead = turn + 0.6
    found = list(ns.continuation.changes_around(label(turn), sign, ahead))
    angles = [angle for angle, _, _ in found]
    assert len(angles) == 2
    assert abs(angles[0] - turn) < 1e-4  # 2 pi / 48 / 2^12
    assert abs(np.sin(angles[1] - turn)) < 1e-4
    assert (found[0][1], found[0][2]) == ("a-", "a+")


def test_the_way_back_is_left_out():
    """The change is straight behind, at ahead + pi."""
    back = label(np.pi)
    angles = [a for a, _, _ in ns.continuation.changes_around(back, sign, 0.0)]
    assert len(angles) == 1
    assert abs(angles[0]) < 1e-4


def test_what_has_no_sign_changes_nothing():
    assert not list(ns.continuation.changes_around(lambda a: "", lambda word: 0, 0.0))


def piece(end, scale=1.0):
    curve = SimpleNamespace(scale=np.array([scale, scale]))
    return Departure(curve, [np.zeros(2)], np.array([1.0, 0.0])), np.array(end)


def traced(ends, last=(), most=24):
    """Pieces that end at given points, one after the other; None where nothing follows."""
    made = [piece(end) for end in ends]
    todo = iter([departure for departure, _ in made[1:]])
    by = {id(departure): end for departure, end in made}

    def follow(departure):
        return SimpleNamespace(points=[SimpleNamespace(u=by[id(departure)])])

    return [
        arc.points[-1].u.tolist()
        for _, arc in pieces(
            made[0][0],
            follow,
            lambda departure, arc: next(todo, None),
            last=lambda arc: arc.points[-1].u.tolist() in [list(v) for v in last],
            most=most,
        )
    ]


def test_a_curve_ends_where_nothing_follows_where_it_closes_and_on_request():
    ends = [[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]
    assert traced(ends) == ends
    assert traced([*ends, [1.0, 1e-9], [9.0, 9.0]]) == [*ends, [1.0, 1e-9]]
    assert traced(ends, last=[[2.0, 0.0]]) == ends[:2]
    assert traced(ends, most=2) == ends[:2]
