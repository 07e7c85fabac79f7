"""Who used which lane when, with what each drove and what it can do."""

from coramp._kernel import FloatArray
from coramp.metrics.separations import LaneUse
from coramp.records.outcome import Outcome


def lane_uses(outcome: Outcome, traits: FloatArray) -> list[LaneUse]:
    """Returns who used each lane of the mainline, and at last who the ramp.

    The mainline's begin with the one next to the ramp, whose acceleration lane counts as the
    ramp's. ``traits`` has one row per vehicle.
    """
    return [_use(outcome, traits, lane) for lane in outcome.lanes.lanes]


def _use(outcome: Outcome, traits: FloatArray, lane: int) -> LaneUse:
    stays, driven = outcome.lanes.in_lane(lane), outcome.driven
    return LaneUse(
        stays.vehicle,
        driven.first,
        driven.rows,
        traits,
        stays.from_s,
        stays.until_s,
        stays.merged,
    )
