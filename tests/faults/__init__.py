"""Faults put into coramp by hand, one at a time, and who catches each."""
