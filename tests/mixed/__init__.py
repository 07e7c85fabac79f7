"""Automated vehicles among drivers: the laws by which they make room and keep their distance."""
