"""The lanes at a merge: their names, and the codes that arrays and kernels use for them."""

LANES = ("ramp", "acceleration", "mainline")
"""Names of the lanes, in the order of their codes: before the nose, beside and on the mainline."""
RAMP, ACCELERATION_LANE, MAINLINE = range(len(LANES))
"""Codes of the lanes: where pieces lie, and how far a vehicle's merge has come."""
