"""What tests run under besides what is said in the conftest.py above: property tests that repeat.

The default hypothesis profile draws the same examples every time, so a clone passes or fails like
any other: 15 of each property, or as many as hypothesis finds good (100) with
`HYPOTHESIS_PROFILE=whole`, which `make check` and CI take. `HYPOTHESIS_PROFILE=explore` draws new
ones, and many more, to look for a counterexample.
"""

import os

import pytest
from hypothesis import settings

from tests.browser import opened

settings.register_profile("quick", derandomize=True, deadline=None, max_examples=15)
settings.register_profile("whole", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=2000, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium (tests/browser.py); tests without it are skipped with the reason."""
    yield from opened()


@pytest.fixture(autouse=True)
def open_defects(request):
    """Expect the failure of tests that the table ``OPEN`` of their module names; one that passes is an error."""
    reason = getattr(request.module, "OPEN", {}).get(request.node.name)
    if reason:
        request.node.add_marker(pytest.mark.xfail(reason=reason, strict=True))


@pytest.fixture(autouse=True, scope="session")
def lanes_for_all():
    """Let ensembles of 64 starts run in lanes, which wait for longer runs where compilation has to pay."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("nonsmooth.flow.ensembles.ensemble._WORTH", 0.0)
        yield
