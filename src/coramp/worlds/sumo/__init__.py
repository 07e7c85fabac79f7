"""The closed loop in SUMO."""
