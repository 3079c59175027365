"""Some of the random branches that ``python -m benchmarks.random_branches`` checks."""

import pytest

from benchmarks import random_branches


@pytest.mark.slow
@pytest.mark.parametrize("kind", random_branches.CLASSES)
def test_nothing_is_wrong_on_a_random_branch(kind, capsys):
    counts = random_branches.main([2, 4], [kind])
    assert counts[f"branches of {kind}"] == 2 and counts["nodes"] > 20
    assert counts["WRONG"] == 0, capsys.readouterr().out
