"""Measured demand: counts of detectors, read from a file."""

from coramp.counts.reading import read_counts
from coramp.counts.table import SCHEMA, Counts, Repair

__all__ = ["SCHEMA", "Counts", "Repair", "read_counts"]
