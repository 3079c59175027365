"""Runs cross, slide and leave where the regions of the surfaces say so."""

import pytest

import nonsmooth as ns
from nonsmooth import textbook

EXPECTED = {
    "crossing": {"+": ("crossing up",), "-": ("crossing down",)},
    "entry": {"s": ("attracting sliding",)},
    "exit": dict.fromkeys(
        "+-",
        ("tangency of the field above", "tangency of the field below", "tangency of both fields"),
    ),
}
#: A root of a field vanishes with its derivative where these slide.
AT_ROOTS = ("super_twisting", "tank_cascade")
NAMES = [name for name in textbook.PROBLEMS if name not in AT_ROOTS]


def changes(system, run):
    """Events at which one surface changes its letter, the others not sliding: its number, and its mode."""
    for event in run.events[:30]:
        before, after = event.mode_before, event.mode_after
        changed = [i for i, pair in enumerate(zip(before, after, strict=True)) if len({*pair}) > 1]
        if event.kind not in EXPECTED or len(changed) != 1 or changed[0] >= system.surface_count:
            continue
        (i,) = changed
        if "s" not in after[:i] + after[i + 1 :]:
            several = system.surface_count > 1 and not (system.impacts or system.complementarity)
            yield event, i, after[:i] + "s" + after[i + 1 :] if several else None


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_regions_agree_with_a_run(name):
    problem = textbook.by_name(name)
    if problem.system.sets or not problem.system.surface_count:
        pytest.skip("no surface")
    for event, i, mode in changes(problem.system, problem.run(tol=1e-12)):
        found = ns.region(problem.system, event.x, surface=i, mode=mode, t=event.t, tol=1e-7)
        assert str(found) in EXPECTED[event.kind][event.mode_after[i]], event
