"""What users install: sdist and wheel are built, and the wheel is run in empty environments."""
