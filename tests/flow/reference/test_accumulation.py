"""The time left before a Zeno point is the sum of a geometric series, and is not claimed otherwise."""

import pytest

from nonsmooth.flow.reference.driver import remaining_time


@pytest.mark.parametrize("r", [0.3, 0.5, 0.7])
def test_the_rest_of_a_geometric_series(r):
    intervals = [r**k for k in range(60)]
    left = remaining_time(intervals, ["impact"] * 60, 1e6)
    assert left == pytest.approx(r**60 / (1 - r), rel=1e-9)


def test_two_alternating_events_shrink_block_by_block():
    """Intervals a, b, a r, b r, ...: a block of two shrinks by r, single ones do not."""
    intervals = [w * 0.5**k for k in range(30) for w in (1.0, 0.2)]
    left = remaining_time(intervals, ["left", "right"] * 30, 1e6)
    assert left == pytest.approx(1.2 * 0.5**30 / 0.5, rel=1e-9)


def test_events_at_one_time_again_and_again_leave_none():
    assert remaining_time([1.0, *[0.0] * 60], ["reset"] * 61, 1.0) == 0.0


def test_pairs_of_events_at_one_time_count_as_one():
    """0, 1/2, 0, 1/8, ...: the blocks of two are 2^-1, 2^-3, ..., 2^-29 and then a third of that."""
    intervals = [0.5**k if k % 2 else 0.0 for k in range(30)]
    assert remaining_time(intervals, ["impact"] * 30, 1.0) == pytest.approx(0.5**29 / 3, rel=1e-9)


@pytest.mark.parametrize(
    "intervals",
    [
        [1.0] * 40,  # steady
        [1.1**k for k in range(40)],  # growing
        [1.0 / (k + 1) for k in range(40)],  # a divergent series
        [1.0, 0.5],  # too few
    ],
)
def test_what_does_not_shrink_by_a_steady_factor_has_no_estimate(intervals):
    assert remaining_time(intervals, ["impact"] * len(intervals), 1.0) is None
