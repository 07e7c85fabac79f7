"""Trajectories of constant acceleration, and what is exact about them; fuel."""
