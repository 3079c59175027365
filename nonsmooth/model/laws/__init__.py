"""Laws of a mode: multipliers that hold a surface, and the smooth field that they give."""
