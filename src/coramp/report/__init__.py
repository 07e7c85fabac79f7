"""Pictures; the only place that draws."""
