"""Some of the random branches that ``python -m benchmarks.random_branches`` checks."""

import pytest

from benchmarks import random_branches


@pytest.mark.slow
@pytest.mark.parametrize("kind", random_branches.CLASSES)
def test_nothing_is_wrong_on_a_random_branch(kind, capsys):
    counts = random_branches.main([2, 4], [kind])
    assert counts[f"branches of {kind}"] == 2 and counts["nodes"] > 20
    assert counts["WRONG"] == 0, capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "event"),
    [
        ("filippov", 20068, "infinite period at a boundary node"),
        ("filippov", 23076, "two-fold"),
        ("filippov", 71332, "two-fold"),
        ("filippov", 50124, "homoclinic"),
    ],
)
def test_ends_of_branches_that_simulation_could_not_follow_are_named(kind, seed, event, capsys):
    counts = random_branches.main([1, seed], [kind])
    assert counts[f"event {event}"] == 1 and counts["WRONG"] == 0, capsys.readouterr().out
