"""Linear complementarity systems event by event, with matrix exponentials; shares no code with the library."""

import itertools

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

#: Times after a point at which a mode's guards are compared.
SOON = (1e-6, 1e-5, 1e-4)


class Circuit:
    """x' = A x + B nu, y = C x + D nu, 0 <= y, nu >= 0, y nu = 0: rows of D that are zero have degree one."""

    def __init__(self, a, b, c, d):
        self.a, self.b, self.c, self.d = (np.array(part, float) for part in (a, b, c, d))
        later = ~self.d.any(axis=1)
        self.later = np.flatnonzero(later)
        self.by_x, self.by_nu = self.c.copy(), self.d.copy()
        self.by_x[later], self.by_nu[later] = self.c[later] @ self.a, self.c[later] @ self.b
        every = (itertools.combinations(range(len(c)), size) for size in range(len(c) + 1))
        modes = [(own, self.mode(list(own))) for one in every for own in one]
        self.modes = [(own, made) for own, made in modes if made is not None]

    def mode(self, own):
        """The field and the guards of a mode as matrices; None where its multipliers do not exist."""
        gain = np.zeros((len(self.c), len(self.a)))
        if own:
            block = self.by_nu[np.ix_(own, own)]
            gain[own] = -np.linalg.pinv(block, rcond=1e-10) @ self.by_x[own]
            if abs(self.by_x[own] + block @ gain[own]).max() > 1e-8:
                return None
        guards = self.c + self.d @ gain
        guards[own] = gain[own]
        return self.a + self.b @ gain, guards

    def choose(self, x):
        """The mode whose guards are positive next."""
        best, found = -np.inf, None
        for own, made in self.modes:
            if any(abs(self.c[i] @ x) > 1e-9 for i in own if i in self.later):
                continue
            soon = min((made[1] @ flow(made[0], x, s)).min() / s for s in SOON)
            score = min(1e-6 * soon, (made[1] @ x).min())
            if score > best + 1e-13:
                best, found = score, made
        assert best > -1e-9, "no mode continues"
        return found

    def run(self, x, t_end, steps=400):
        """The state at the end; steps without an event are exact."""
        x, t, h = np.array(x, float), 0.0, t_end / steps
        while t_end - t > 1e-13:
            field, guards = self.choose(x)
            step = expm(field * h)
            while t_end - t > 1e-13:
                dt = min(h, t_end - t)
                new = step @ x if dt == h else flow(field, x, dt)
                passed = np.flatnonzero(guards @ new < -1e-13 * (1 + abs(new).max()))
                if len(passed):
                    dt = min(root(field, guards[i], x, dt) for i in passed)
                    x, t = flow(field, x, dt), t + dt
                    break
                x, t = new, t + dt
        return x


def flow(field, x, s):
    """exp(s F) x by its series, for short times."""
    term = result = x
    for k in range(1, 25):
        term = s / k * (field @ term)
        result = result + term
    return result


def root(field, guard, x, dt):
    """The first zero of a guard that falls within a short time."""
    value, low = lambda s: guard @ flow(field, x, s), 1e-9 * dt
    while value(low) <= 0 and low < dt:
        low *= 4
    return brentq(value, low, dt, xtol=1e-16) if low < dt else 1e-12


def driven(a, by_source, omega=1.0):
    """Rates of states that are driven by sin(omega t), whose sine and cosine are two more states."""
    a, n = np.array(a, float), len(a)
    made = np.zeros((n + 2, n + 2))
    made[:n, :n], made[:n, n] = a, by_source
    made[n, n + 1], made[n + 1, n] = omega, -omega
    return made
