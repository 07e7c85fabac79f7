"""Whether the log of a run says what the run claims: decisions, kinematics, positions, figures.

``orders``, ``kinematics``, ``positions``, ``neighbours`` and ``figures`` are the checker's
mathematics on a whole run: they import nothing of planners, loop and metrics.
"""
