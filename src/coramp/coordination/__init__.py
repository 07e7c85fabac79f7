"""The loop that engines and a live service share: events, examination, commitments, records."""
