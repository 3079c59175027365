"""An itinerary as it is given, a word or a list, and the legs that it means."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..model import FilippovSystem, OptionError, explain
from .itinerary import leg_between, read_word
from .legs import Leg

Itinerary = str | Sequence[str] | Sequence[tuple[str, str]]


def word_legs(system: FilippovSystem, itinerary: Itinerary, mirrored: bool) -> tuple[Leg, ...]:
    """The legs of an itinerary, of which the first follows the last one, or its mirror image does."""
    word: Any = itinerary if isinstance(itinerary, str) else _listed(itinerary)

    def read() -> tuple[Leg, ...]:
        modes = read_word(system, word) if isinstance(word, str) or not word else word
        pairs = [(e, "") if isinstance(e, str) else e for e in modes]
        following = [mode for mode, _ in pairs[1:]] + [pairs[0][0]]
        if mirrored:
            following[-1] = following[-1].translate(str.maketrans("+-", "-+"))
        told = zip(pairs, following, strict=True)
        return tuple(leg_between(system, mode, then, name) for (mode, name), then in told)

    try:
        return system.cached(("word", word, mirrored), read)
    except TypeError:  # of lists, which are no keys
        return read()


def lone_leg(system: FilippovSystem, itinerary: Itinerary) -> Leg | None:
    """The leg without an event that one mode alone means; None where something can happen to the mode."""
    if system.resets or system.impacts:
        return None
    word: Any = itinerary if isinstance(itinerary, str) else _listed(itinerary)
    modes = read_word(system, word) if isinstance(word, str) else word
    if len(modes) != 1 or not isinstance(modes[0], str):
        return None
    system.parse_letters(modes[0])
    return Leg(modes[0])


def _listed(itinerary: Any) -> tuple[Any, ...]:
    """Modes, or pairs of a mode and a name, as they were given."""
    try:
        word = tuple(itinerary)
    except TypeError:
        word = (None,)
    for entry in word:
        names = (entry,) if isinstance(entry, str) else entry
        pair = isinstance(names, (tuple, list)) and len(names) in (1, 2)
        if not pair or not all(isinstance(name, str) for name in names):
            raise OptionError(
                explain(
                    "itinerary",
                    expected="modes, such as '+ s -', or pairs of a mode and the name of its event",
                    received=repr(itinerary),
                    advice="Write for example '+ s -' or [('', 'floor')].",
                )
            )
    return tuple(e if isinstance(e, str) else tuple(e) for e in word)
