"""Scenarios: a road, its vehicles, its traffic and its controller, as validated files."""
