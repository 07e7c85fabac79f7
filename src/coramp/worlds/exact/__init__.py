"""Commitments in closed form: no simulator and no time step."""
