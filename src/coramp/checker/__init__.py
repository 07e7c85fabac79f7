"""The independent checker: every plan passes here before it is committed.

It takes raw pieces and imports nothing that the planners use; only how functions are compiled is
shared.
"""
