"""Vehicles as arrays: what they have committed to, and how near they come to one another."""
