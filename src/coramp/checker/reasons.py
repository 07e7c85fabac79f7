"""Why a change is refused, and how exactly that is measured."""

(
    ACCEPTED,
    NOT_FINITE,
    TIMES_NOT_ASCENDING,
    STARTS_TOO_EARLY,
    LEAVES_ITS_PATH,
    HAS_A_JUMP,
    TOO_FAST,
    BACKWARDS,
    TOO_HARD,
    MERGES_OUTSIDE_LANE,
    NO_SAFE_END,
    TOO_NEAR,
    TOO_NEAR_AT_MERGE,
    CHANGES_THE_PAST,
    STARTS_TOO_LATE,
    HOLDS_NEWCOMERS,
    TAKES_NO_COMMANDS,
    CHANGES_LANE_WRONGLY,
) = range(18)

REASONS = (
    "accepted",
    "a value is not finite",
    "times do not ascend",
    "starts before the vehicle can act",
    "does not start where the vehicle is",
    "pieces do not join",
    "faster than allowed",
    "drives backwards",
    "accelerates or brakes harder than allowed",
    "merges outside the acceleration lane",
    "does not end in a cruise on the mainline or a stop before the nose",
    "comes nearer than the safe distance of Eq. 1",
    "comes nearer than Eq. 15 or 16 at the lane change",
    "changes a lane change that has happened, or the stream",
    "starts later than the vehicle can act: what it drives until then is missing",
    "may hold up a mainline vehicle that is yet to enter, which its strategy does not declare",
    "commands a vehicle that takes no commands: a driver, or one that never entered",
    "changes lanes twice, before it can, before it is on the mainline, or to a lane there is not",
)

JOIN = 1e-6
"""Tolerance (s, m, m/s, m/s2) for pieces to join and bounds to hold."""
EXACT = 1e-9
"""Tolerance (m) for distances."""
