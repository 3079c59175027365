"""One module for each peer, as strong as its own interface lets us make it.

Each offers ``make(problem, tolerance) -> solve`` and ``solve(starts) -> Ends``; none has Filippov's
logic, so that is written here for each: one smooth solver per mode, terminal events, and the choice
of the next mode between runs. None can start on a surface without seeing it as an event at once:
the state is pushed off by ``NUDGE``.
"""

NUDGE = 1e-15
