"""Solvers by other tools, each in its fastest form.

Each module has ``make(problem, tolerance) -> solve`` and ``solve(starts) -> Ends``. Filippov's rules are
added here: one smooth solver per mode, terminal events, and the choice of the next mode. States are
pushed off a surface by ``NUDGE``, as it would be an event at once.
"""

NUDGE = 1e-15
