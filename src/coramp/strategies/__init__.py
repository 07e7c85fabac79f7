"""Strategies: who yields to whom."""
