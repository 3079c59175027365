"""Lanes: several trajectories in step, by one vectorised C text."""
