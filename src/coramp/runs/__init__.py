"""One run or one decision, from its specification to its tables."""
