"""Runs: long and short ones, their first result, what they keep, memory and scaling."""
