"""The loop that engines and a live service share: events, commitments, audit, records."""
