"""Rows of runs as one commit gave them, to be compared with what the code gives now."""
