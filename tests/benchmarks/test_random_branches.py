"""Some of the random branches that ``python -m benchmarks.random_branches`` checks."""

from collections import Counter

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
    ("kind", "seed", "events"),
    [
        ("filippov", 20068, ["infinite period at a boundary node"]),
        ("filippov", 23076, ["two-fold", "adding-sliding"]),
        ("filippov", 71332, ["two-fold"]),
        ("filippov", 50124, ["homoclinic"]),
        ("filippov", 81564, ["cycle from a two-fold"]),
        ("filippov", 82037, ["period doubling", *["switching-sliding"] * 2, "two-fold"]),
        ("relay", 83057, ["adding-sliding", "boundary equilibrium"]),
    ],
)
def test_ends_of_branches_that_simulation_could_not_follow_are_named(kind, seed, events, capsys):
    counts = Counter[str]()
    branch = random_branches.checked(kind, seed, counts)
    assert branch is not None and [event.kind for event in branch.events] == events
    assert counts["WRONG"] == 0, capsys.readouterr().out
