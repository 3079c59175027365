"""Guards with zeros that are close together: each is passed, or touched, and none is lost or doubled."""

import math
import random

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import nonsmooth as ns

x, y = ca.SX.sym("x"), ca.SX.sym("y")
#: Fields of x, starts of runs to x = 3, and the time from the start to a value.
MOTIONS = {
    "even": (1, 0.0, mp.mpf),
    "growing": (x, 0.1, lambda a: mp.log(a / mp.mpf(0.1))),
    "bent": (1 + x * x / 2, 0.0, lambda a: mp.sqrt(2) * mp.atan(a / mp.sqrt(2))),
}
motions = pytest.mark.parametrize("motion", MOTIONS)


def passes(guard, motion, direction):
    """Times at which a reset is due; each is counted in y."""
    field, start, when = MOTIONS[motion]
    count = ns.Reset(guard, [x, y + 1], direction=direction)
    system = ns.FilippovSystem([x, y], field=[field, 0], resets=count)
    run = ns.simulate(system, [start, 0.0], float(when(mp.mpf(3))), tol=1e-12)
    assert run.status is ns.Status.REACHED_END
    return [event.t for event in run.events if event.kind == "reset"]


def expected(zeros, sign, direction):
    """Zeros, each with whether it is passed, where the guard has ``sign`` before them."""
    for zero, is_passed in zeros:
        if is_passed and direction in (0, -sign):
            yield zero
        sign *= 1 - 2 * is_passed


@motions
def test_zeros_in_a_cluster(motion):
    """Factors: two to five of distances 1e-3 to 1e-10, some twice, and sometimes one far away."""
    for seed in range(16):
        choose = random.Random(f"{motion} {seed}")
        gap, zeros = 10 ** choose.uniform(-10, -3), [choose.uniform(0.3, 1.5)]
        for _ in range(choose.randint(1, 4)):
            zeros.append(zeros[-1] + gap * choose.uniform(0.5, 2))
        zeros += [choose.uniform(1.8, 2.9)] * choose.randint(0, 1)
        each = [(zero, choose.random() < 0.8) for zero in zeros]
        size = choose.choice([-1, 1]) * 10 ** choose.uniform(-3, 3)
        guard, direction = ca.SX(size), choose.choice([-1, 0, 1])
        for zero, is_passed in each:
            guard *= (x - zero) * (1 if is_passed else ca.sin(x - zero))
        sign = int(np.sign(size)) * (-1) ** sum(is_passed for _, is_passed in each)
        when = MOTIONS[motion][2]
        times = [float(when(mp.mpf(zero))) for zero in expected(each, sign, direction)]
        assert passes(guard, motion, direction) == pytest.approx(times, abs=1e-10, rel=0), seed


def test_a_touch_after_two_zeros_in_one_direction():
    """The residual of the first event is no zero of what follows the second."""
    first, second, touched = 1.1060725023078326, 1.106075028716518, 1.1060804522925578
    guard = (
        (x - first) * (x - second) * (x - touched) * ca.sin(x - touched) * (x - 1.8284017703851982)
    )
    when = MOTIONS["bent"][2]
    for size in (-1.0, 1.0):
        zeros = [(first, True), (second, True), (touched, False), (1.8284017703851982, True)]
        for direction in (-1, 1):
            times = [float(when(mp.mpf(z))) for z in expected(zeros, -int(size), direction)]
            assert passes(size * guard, "bent", direction) == pytest.approx(times, abs=1e-10, rel=0)


@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("multiplicity", [2, 3, 4])
@motions
def test_a_multiple_zero_of_a_sum(motion, multiplicity, direction):
    """Expanded, with exact coefficients: rounding of the terms hides how often it is passed."""
    for zero in (0.421875, 0.75, 1.40625, 1.734375, 2.0625):
        terms = [math.comb(multiplicity, k) * (-zero) ** (multiplicity - k) * x**k for k in range(multiplicity + 1)]  # fmt: skip
        count = multiplicity == 3 and direction >= 0
        assert len(passes(sum(terms), motion, direction)) == count, zero


@pytest.mark.filterwarnings("ignore:Descending")
@motions
def test_zeros_of_a_sum(motion):
    """Coefficients of clusters; zeros by mpmath, where rounding of the terms does not hide the guard's extremes."""
    mp.mp.dps, judged = 60, 0
    for seed in range(14):
        choose = random.Random(f"{motion} {seed}")
        first, gap = choose.uniform(0.3, 2.5), 10 ** choose.uniform(-6, -2)
        near = [first + k * gap * choose.uniform(0.8, 1.2) for k in range(choose.randint(2, 4))]
        terms = [mp.mpf(a) for a in np.poly(near)]
        rates = [a * (len(terms) - 1 - k) for k, a in enumerate(terms[:-1])]
        real = [
            sorted(z.real for z in mp.polyroots(p, 500, extraprec=400) if abs(z.imag) < 1e-30)
            for p in (terms, rates)
        ]
        noise = np.finfo(float).eps * sum(abs(a) * first**k for k, a in enumerate(terms[::-1]))
        if any(abs(mp.polyval(terms, z)) < 100 * noise for z in real[1]):
            continue
        judged += 1
        direction, sign = choose.choice([-1, 0, 1]), (-1) ** (len(terms) - 1)
        required = expected([(zero, True) for zero in real[0]], sign, direction)
        times = [float(MOTIONS[motion][2](zero)) for zero in required]
        guard = sum(float(a) * x**k for k, a in enumerate(terms[::-1]))
        assert passes(guard, motion, direction) == pytest.approx(times, abs=1e-6, rel=0), seed
    assert judged > 3


@pytest.mark.parametrize(("power", "kind"), [(3, "reset"), (5, "reset"), (3, "crossing")])
def test_a_multiple_zero_that_is_written_out_says_how_well_it_is_located(power, kind):
    def at_one(guard):
        if kind == "crossing":
            system = ns.FilippovSystem([x, y], surface=guard, above=[1, 1], below=[1, 0])
        else:
            count = ns.Reset(guard, [x, y + 1], direction=1)
            system = ns.FilippovSystem([x, y], field=[1, 0], resets=count)
        run = ns.simulate(system, [0.0, 0.0], 2.0)
        (event,) = [event for event in run.events if event.kind == kind]
        return abs(event.t - 1), run.facts.t_error

    written_out = sum(math.comb(power, k) * (-1) ** (power - k) * x**k for k in range(power + 1))
    error, said = at_one(written_out)
    assert error < said < 10 * (power * 2**-50) ** (1 / power)
    error, said = at_one(x - 1)
    assert error < 1e-15 and said == 0
