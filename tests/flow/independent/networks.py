"""Random networks of ideal diodes, resistors, coils, capacitors and sources, by their tableau; shares no code with the library."""

import numpy as np


def network(seed, diodes=None):
    """Matrices of a linear complementarity system and a start: states, then the sine, cosine and 1 of the sources."""
    rng = np.random.default_rng(seed)
    while True:
        nodes, some = rng.integers(3, 6), diodes or rng.integers(1, 7)
        counts = [
            rng.integers(0, 2),
            rng.integers(0, 2),
            rng.integers(1, 4),
            *rng.integers(0, (3, 4)),
        ]
        kinds = "".join(kind * n for kind, n in zip("VICLR", counts, strict=True)) + "D" * some
        ends = [rng.choice(nodes, 2, replace=False) for _ in kinds]
        values = np.exp(0.6 * rng.normal(size=len(kinds)))
        made = _matrices(kinds, ends, values, rng.integers(0, 2, len(kinds)), nodes, rng)
        if made is not None:
            return made


def _matrices(kinds, ends, values, by_voltage, nodes, rng):
    """Diodes bring their current, or ``by_voltage`` their reverse voltage; None where that determines no network."""
    n, size = nodes - 1, nodes - 1 + len(kinds)
    incidence = np.zeros((nodes, len(kinds)))
    for k, (a, b) in enumerate(ends):
        incidence[a, k], incidence[b, k] = 1, -1
    incidence = incidence[1:]
    own = {kind: [k for k, e in enumerate(kinds) if e in kind] for kind in ("CL", "VI", "D")}
    given = [k for part in own.values() for k in part]
    left, right = np.zeros((size, size)), np.zeros((size, len(given)))
    left[:n, n:] = incidence
    for k, kind in enumerate(kinds):
        voltage, current = np.zeros(size), np.zeros(size)
        voltage[:n], current[n + k] = incidence[:, k], 1
        of_voltage = kind in "CV" or (kind == "D" and by_voltage[k])
        left[n + k] = (
            voltage - values[k] * current if kind == "R" else voltage if of_voltage else current
        )
        if kind != "R":
            right[n + k, given.index(k)] = -1 if kind == "D" and by_voltage[k] else 1
    if np.linalg.cond(left) > 1e8:
        return None
    found = np.linalg.solve(left, right)
    voltages, currents = incidence.T @ found[:n], found[n:]
    rates = [(currents if kinds[k] == "C" else voltages)[k] / values[k] for k in own["CL"]]
    y = [currents[k] if by_voltage[k] else -voltages[k] for k in own["D"]]
    rates, y = (np.where(abs(part := np.array(rows)) < 1e-12, 0, part) for rows in (rates, y))
    states, sources = len(rates), len(own["VI"])
    if not (y.any(axis=1).all() and np.vstack([rates, y])[:, states + sources :].any(axis=0).all()):
        return None
    amplitudes = rng.normal(size=(sources, 3)) * [1.5, 1.5, 0.7]
    a = np.zeros((states + 3, states + 3))
    a[:states, :states], a[:states, states:] = (
        rates[:, :states],
        rates[:, states : states + sources] @ amplitudes,
    )
    a[states, states + 1] = rng.uniform(0.5, 3)
    a[states + 1, states] = -a[states, states + 1]
    b = np.vstack([rates[:, states + sources :], np.zeros((3, len(own["D"])))])
    c = np.hstack([y[:, :states], y[:, states : states + sources] @ amplitudes])
    return (a, b, c, y[:, states + sources :]), np.array([*rng.normal(size=states), 0, 1, 1])
