"""Grids of runs: definition, store, runner, tables."""
