"""Counts of detectors: what a file of them holds, what does not add up in it, and its repair."""
