"""What a run does at impacts: impulses, rest after they accumulate, release."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...model import Guard, coupled_of
from .. import messages
from ..names import change, guard_name
from ..status import Status
from .contacts import Contacts

if TYPE_CHECKING:
    from .driver import Driver


def contacts_of(driver: Driver) -> Contacts | None:
    """Return the laws of the contacts of a run, if it has any."""
    if not driver.system.impacts:
        return None
    coupled = coupled_of(driver.system)
    return Contacts(driver.system, coupled, driver.surfaces, driver.p, driver.options)


def resting(driver: Driver) -> list[int]:
    """Contacts with neither a gap nor a rate; the run ends where a gap is negative."""
    if driver.contacts is None:
        return []
    behind = driver.contacts.behind(driver.x)
    if behind is not None:
        message = messages.behind(driver.system.impacts[behind], driver.t)
        driver.end(Status.INCONSISTENT, message)
    gaps, rates = driver.contacts.gaps(driver.x)
    first = driver.system.surface_count
    return [first + j for j in np.flatnonzero((gaps == 0.0) & (rates == 0.0)).tolist()]


def strike_due(driver: Driver) -> None:
    """Look at the closed gaps."""
    if driver.contacts is None or driver.ended is not None:
        return
    gaps, rates = driver.contacts.gaps(driver.x)
    driver.due_impact = None
    for row, guard in enumerate(driver.stepper.guards(driver.mode)):
        if guard.kind == "impact" and gaps[guard.index] == 0.0:
            if rates[guard.index] < 0.0:
                driver.due_impact = guard
            elif rates[guard.index] > 0.0:
                driver.drops[row] = 1


def impact(driver: Driver, guard: Guard) -> None:
    """The impulses of a gap that closes, and of the contacts that are closed there."""
    assert driver.contacts is not None
    before, x = driver.mode, driver.x
    onto = {driver.system.surface_count + guard.index, *driver.kept(driver.mode)}
    driver.x = driver.surfaces.project(x, driver.p, sorted(onto))
    first = driver.system.surface_count
    touched = {first + j for j in driver.contacts.touched(driver.x)} - onto
    if touched:  # by what the root's error moves a neighbour
        driver.x = driver.surfaces.project(driver.x, driver.p, sorted(onto | touched))
    driver.record.correct(driver.x)
    x = driver.x
    gaps, rates = driver.contacts.gaps(x)
    involved = [j for j in range(len(gaps)) if gaps[j] == 0.0 and rates[j] <= 0.0]
    involved = sorted({*involved, guard.index})
    improper = driver.contacts.improper(x, involved)
    if improper is not None:
        message = messages.restitution(driver.system.impacts[improper], driver.t)
        return driver.end(Status.INCONSISTENT, message)
    after = driver.contacts.strike(x, driver.mode, involved, False)
    if after is None:
        return driver.end(
            Status.INCONSISTENT, messages.no_impulse(guard_name(driver.system, guard), driver.t)
        )
    driver.x = after
    driver.note()
    driver.settle_in()
    driver.event("impact", before, guard, x)
    driver.arm()


def release(driver: Driver, guard: Guard) -> None:
    """Let a contact go whose reaction has fallen to zero."""
    before, j = driver.mode, guard.index
    active = driver.active({driver.system.surface_count + j}, driver.mode)
    known = {("release", j, 0): 1, ("impact", j, 1): 3}
    driver.go_on(active, known, before, guard)


def come_to_rest(driver: Driver, left: float) -> bool:
    """After impacts that accumulate the contact is closed; whether there is one."""
    if driver.contacts is None or not all(p.startswith("impact") for p in driver.patterns[-6:]):
        return False
    gaps, _ = driver.contacts.gaps(driver.x)
    involved = np.flatnonzero(gaps == 0.0).tolist()
    x = driver.contacts.strike(driver.x, driver.mode, involved, True)
    if x is None:
        return False
    before, first = driver.mode, driver.system.surface_count
    driver.x = driver.surfaces.project(x, driver.p, _kept_by(driver, involved))
    letters = driver.letters()
    active = driver.active({first + j for j in involved}, letters)
    if not driver.choose(active, letters, {}):
        return True
    driver.note()
    driver.intervals, driver.patterns = [], []
    e = driver.expand()
    if "c" in driver.mode and e.finite and driver.advance(e, left):
        closed = [j for j in involved if before[first + j] != driver.mode[first + j]]
        name = " and ".join(driver.system.impacts[j] for j in closed)
        driver.limit = driver.t
        of = [Guard("release", j, 0, len(driver.system.entries) + j) for j in closed]
        driver.event(change(before, driver.mode), before, of[0] if of else None, name=name)
    return True


def _kept_by(driver: Driver, contacts: Sequence[int]) -> list[int]:
    m, c = driver.system.surface_count, len(driver.system.impacts)
    return [*[m + j for j in contacts], *[m + c + j for j in contacts]]
