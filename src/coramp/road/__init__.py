"""The road, and what is allowed on it."""
