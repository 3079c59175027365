"""Linear complementarity systems event by event, with matrix exponentials; shares no code with the library."""

import itertools

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

#: Times after a point at which a mode's guards are compared.
SOON = (1e-6, 1e-5, 1e-4)


#: Modes of a run at most.
MOST = 200


class Circuit:
    """x' = A x + B nu, y = C x + D nu, 0 <= y, nu >= 0, y nu = 0: what D leaves undetermined follows from the rates."""

    def __init__(self, a, b, c, d):
        self.a, self.b, self.c, self.d = (np.array(part, float) for part in (a, b, c, d))
        every = (itertools.combinations(range(len(c)), size) for size in range(len(c) + 1))
        modes = [self.mode(list(own)) for one in every for own in one]
        self.modes = [made for made in modes if made is not None]

    def mode(self, own):
        """The field, guards and equations of the states of a mode as matrices; None where it has no multipliers."""
        gain, held = np.zeros((len(self.c), len(self.a))), np.zeros((0, len(self.a)))
        if own:
            block, by_x = self.d[np.ix_(own, own)], self.c[own]
            u, s, _ = np.linalg.svd(block)
            left, null = u[:, s > 1e-9].T, u[:, s <= 1e-9].T
            by_nu = np.vstack([left @ block, null @ by_x @ self.b[:, own]])
            right = np.vstack([left @ by_x, null @ by_x @ self.a])
            gain[own] = -np.linalg.pinv(by_nu, rcond=1e-9) @ right
            if abs(right + by_nu @ gain[own]).max() > 1e-8:
                return None
            held = null @ by_x
        guards = self.c + self.d @ gain
        guards[own] = gain[own]
        return self.a + self.b @ gain, guards, held

    def choose(self, x):
        """The mode whose guards are positive next, or None."""
        best, found = -np.inf, None
        for made in self.modes:
            if abs(made[2] @ x).max(initial=0) > 1e-8:
                continue
            soon = min((made[1] @ flow(made[0], x, s)).min() / s for s in SOON)
            score = min(1e-6 * soon, (made[1] @ x).min())
            if score > best + 1e-13:
                best, found = score, made
        return found if best > -1e-6 else None

    def run(self, x, t_end, steps=400):
        """The state at the end, or None where no mode continues; steps without an event are exact."""
        x, t, h, switches = np.array(x, float), 0.0, t_end / steps, 0
        while t_end - t > 1e-13:
            made, switches = self.choose(x), switches + 1
            if made is None or switches > MOST:
                return None
            field, guards, _ = made
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
