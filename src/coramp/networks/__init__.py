"""SUMO networks as values: their on-ramps, and stations along each of them."""
