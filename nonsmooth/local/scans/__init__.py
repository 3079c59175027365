"""Scans of a box for all special points: planar systems and surfaces of three states."""
