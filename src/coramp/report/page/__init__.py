"""Pages that show runs: the report, the replay and what the studio and notebooks embed."""
