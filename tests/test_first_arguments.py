"""Whatever public function is given what is no argument of its kind says what it expected.

Not that an attribute is missing, that something is not iterable or not callable: the words of Python
about the inside of a function, which its user does not know.
"""

import inspect

import matplotlib.pyplot as plt
import pytest

import bounce
import nonsmooth as ns

PACKAGES = [
    *(ns, ns.local, ns.orbit, ns.plot, ns.two_folds),
    *(bounce, bounce.golf, bounce.laws, bounce.plot),
]
#: Classes that a user passes; functions return the others.
CLASSES = [ns.FilippovSystem, ns.Clock, ns.Grid, ns.RandomStarts, ns.orbit.FixedItinerary, ns.Work]

#: What Python says of a function's inside.
INSIDE = (
    *("has no attribute", "not iterable", "not callable", "not subscriptable", "unsized"),
    *("has no len()", "could not convert", "takes no keyword", "unsupported operand"),
)


def public():
    """Every public function, and the classes whose objects users make, by name."""
    found = {
        f"{package.__name__}.{n}": getattr(package, n)
        for package in PACKAGES
        for n in package.__all__
    }
    kept = {name: f for name, f in found.items() if inspect.isfunction(f) or f in CLASSES}
    return {name: f for name, f in kept.items() if _takes(f)}


def _takes(function):
    """What a function takes; nothing if it takes nothing by place."""
    every = list(inspect.signature(function).parameters.values())
    return every if every and every[0].kind in (0, 1) else []


def called(function, first):
    """Call it with a wrong first argument, and 1 wherever something is needed."""
    place, named = [first], {}
    for one in _takes(function)[1:]:
        if one.default is not one.empty or one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD):
            continue
        if one.kind is one.KEYWORD_ONLY:
            named[one.name] = 1.0
        else:
            place.append(1.0)
    return function(*place, **named)


FUNCTIONS = public()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_wrong_first_argument_is_refused_in_words(name):
    for first in (3, None, "x"):
        try:
            called(FUNCTIONS[name], first)
        except ns.NonsmoothError as error:
            assert len(str(error)) > 20, (first, error)
            if next(iter(_takes(FUNCTIONS[name]))).name == "system":
                assert isinstance(error, ns.DefinitionError) and "FilippovSystem" in str(error)
        except (TypeError, ValueError) as error:
            assert not any(words in str(error) for words in INSIDE), (first, error)
    plt.close("all")


def test_a_shot_is_named_where_another_thing_is_given():
    with pytest.raises(ns.OptionError, match="shot"):
        bounce.sensitivity(3, ["mu"])
