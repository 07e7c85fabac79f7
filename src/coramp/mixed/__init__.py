"""Automated vehicles among drivers: who makes room for whom, and what each does on board."""
