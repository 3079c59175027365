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

    def mode(self, closed):
        """The field and the guards of a mode as matrices; None where its multipliers do not exist."""
        own, gain = list(closed), np.zeros((len(self.c), len(self.a)))
        if own:
            block = self.by_nu[np.ix_(own, own)]
            gain[own] = -np.linalg.pinv(block, rcond=1e-10) @ self.by_x[own]
            if abs(self.by_x[own] + block @ gain[own]).max() > 1e-8:
                return None
        open_rows = self.c + self.d @ gain
        rows = [gain[i] if i in own else open_rows[i] for i in range(len(self.c))]
        return self.a + self.b @ gain, np.array(rows)

    def choose(self, x):
        """The mode whose guards are positive next."""
        best = (-np.inf, ())
        for size in range(len(self.c) + 1):
            for closed in itertools.combinations(range(len(self.c)), size):
                on = all(abs(self.c[i] @ x) < 1e-9 for i in closed if i in self.later)
                made = self.mode(closed) if on else None
                if made is None:
                    continue
                soon = min((made[1] @ expm(made[0] * s) @ x).min() / s for s in SOON)
                score = min(1e-6 * soon, (made[1] @ x).min())
                best = max(best, (score, closed)) if score > best[0] + 1e-13 else best
        assert best[0] > -1e-9, "no mode continues"
        return best[1]

    def run(self, x, t_end, steps=2000):
        """The state at the end; steps without an event are exact."""
        x, t, h = np.array(x, float), 0.0, t_end / steps
        while t_end - t > 1e-13:
            field, guards = self.mode(self.choose(x))
            step = expm(field * h)
            while t_end - t > 1e-13:
                dt = min(h, t_end - t)
                new = step @ x if dt == h else expm(field * dt) @ x
                passed = np.flatnonzero(guards @ new < -1e-13 * (1 + abs(new).max()))
                if len(passed):
                    dt = min(self._root(field, guards[i], x, dt) for i in passed)
                    x, t = expm(field * dt) @ x, t + dt
                    break
                x, t = new, t + dt
        return x

    def _root(self, field, guard, x, dt):
        value, low = lambda s: guard @ expm(field * s) @ x, 1e-9 * dt
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
