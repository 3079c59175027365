"""A system as a tape that core runs, and the functions of the lanes printed from it as C."""
