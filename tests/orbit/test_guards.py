"""Every kind of guard has its condition in words, by its side."""

import pytest

from nonsmooth.model import Guard
from nonsmooth.orbit.guards import described


@pytest.mark.parametrize(
    ("guard", "words"),
    [
        (Guard("surface", 0, 1, "h0"), "h0 > 0"),
        (Guard("surface", 2, -1, "h2"), "h2 < 0"),
        (Guard("exit", 0, 1, "L_F1 h"), "the condition L_F1 h <= 0 of sliding"),
        (Guard("exit", 0, -1, "L_F2 h"), "the condition L_F2 h >= 0 of sliding"),
        (Guard("exit", 1, 1, "lambda1"), "lambda1 <= 1"),
        (Guard("exit", 1, -1, "lambda1"), "lambda1 >= -1"),
        (Guard("impact", 0, 1, "floor"), "the gap of 'floor' >= 0"),
        (Guard("release", 0, 1, "floor"), "the reaction of 'floor' >= 0"),
        (Guard("stop", 0, 1, "end"), "end"),
    ],
)
def test_a_guard_is_told_as_the_condition_that_holds(guard, words):
    assert described(guard) == words
