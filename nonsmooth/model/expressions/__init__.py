"""Expression graphs: Taylor rules, jets, simplification and tests of identity and linearity."""
