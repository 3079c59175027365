"""A system as lists of instructions that core runs, and the functions of the lanes printed from it as C."""
