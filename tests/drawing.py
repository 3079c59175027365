"""How many examples property tests draw that need not draw as many as others."""

from hypothesis import settings


def at_most(count: int) -> settings:
    """So many examples, or as many as the profile (conftest.py) draws if those are fewer."""
    return settings(max_examples=min(count, settings.default.max_examples), deadline=None)
