"""The readable truth: Taylor steps, roots, Filippov's logic and accumulation in pure Python."""
