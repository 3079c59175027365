"""Derivatives of a run, forward and back, of its end, its samples and its events, beside differences of runs."""

import numpy as np

import nonsmooth as ns


def require(system, start, t_end, itinerary=None, **options) -> ns.orbit.Sensitivity:
    """Compare all derivatives of a run with differences of order six of its neighbours, which have its itinerary.

    Directions are those of start and parameters: all, those ``of`` some numbers, or ``directions``. ``within`` is the
    tolerance of states, 100 times that of times; of ``ends`` alone, where events accumulate, the itinerary may differ,
    and ``rows`` are the states that are compared.
    """
    n, times, t_start = len(start), options.get("times"), options.get("t_start", 0.0)
    z = np.concatenate([start, system.parameter_vector(options.get("parameters"))])
    within, h, only = (
        options.get("within", 1e-10),
        options.get("h", 1e-4),
        options.get("ends", False),
    )
    kept = options.get("rows", slice(None))

    def run(z, tol):
        given = dict(zip(system.parameter_names, z[n:], strict=True))
        other = {"t_start": t_start, "parameters": given, "t_eval": times}
        return ns.simulate(system, z[:n], t_end, tol=tol, **other)

    def values(z):
        other = run(z, options.get("tol", 1e-14))
        if only:
            return other.x[-1, kept]
        assert other.itinerary == own.itinerary
        samples = [] if times is None else other.sample_x.ravel()
        moments = [event.t for event in other.events]
        return np.concatenate([other.x[-1], samples, moments[:count], moments[-1:]])

    own = run(z, max(1e-13, options.get("tol", 0.0)))
    assert not itinerary or own.itinerary.endswith(itinerary.lstrip(".")), own.itinerary
    s = ns.sensitivity(own)
    count, whole = len(s.event_times), np.hstack([s.dx_dx0, s.dx_dp])
    samples = np.zeros((0, len(z)))
    if times is not None:
        samples = np.concatenate([s.dsample_dx0, s.dsample_dp], axis=2)
    of_times = np.hstack([s.dt_dx0, s.dt_dp])
    of_end = np.concatenate([s.dt_end_dx0, s.dt_end_dp])
    every = np.vstack([whole, samples.reshape(-1, len(z)), of_times, of_end])
    found = whole[kept] if only else every
    size = 1 + np.abs(found).max()
    for e in options.get("directions", np.eye(len(z))[options.get("of", slice(None))]):
        one, two, three = (values(z + k * h * e) - values(z - k * h * e) for k in (1, 2, 3))
        error = np.abs((45 * one - 9 * two + three) / (60 * h) - found @ e)
        states = len(error) - (0 if only else count + 1)
        assert error[:states].max() < within * size, (e, error)
        assert error[states:].max(initial=0) < 100 * within * size, (e, error)
    rng = np.random.default_rng(1)
    row, rows = rng.normal(size=n), None if times is None else rng.normal(size=(len(times), n))
    back = np.concatenate(ns.vjp(own, row, samples=rows))
    expected = row @ whole + (0 if rows is None else np.einsum("ki,kij->j", rows, samples))
    assert np.abs(back - expected).max() < 1e-11 * size
    return s
