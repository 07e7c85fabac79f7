"""MixedMerge-v0: automated vehicles among SUMO's drivers as agents."""
