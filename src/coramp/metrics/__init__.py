"""What a run amounts to, computed from its records alone."""
