"""A world that fails: messages late or lost, positions wrong, vehicles slow to react.

Each fault has its own random numbers, and changes nothing while it is off.
"""
