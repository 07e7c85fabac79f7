"""Drivers as measured: a population fitted to what detectors told."""
