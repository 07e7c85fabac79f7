"""The studio: a local page whose sliders set a scenario that is computed on the fly."""
