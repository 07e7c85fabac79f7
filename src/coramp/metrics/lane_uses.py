"""Who used which lane when, with what each drove and what it can do."""

from coramp._kernel import FloatArray
from coramp.metrics.separations import LaneUse
from coramp.records.outcome import Outcome


def lane_uses(outcome: Outcome, traits: FloatArray) -> tuple[LaneUse, LaneUse]:
    """Returns who used the mainline, and who the ramp with its acceleration lane.

    ``traits`` has one row per vehicle.
    """
    return _use(outcome, traits, mainline=True), _use(outcome, traits, mainline=False)


def _use(outcome: Outcome, traits: FloatArray, mainline: bool) -> LaneUse:
    stays, driven = outcome.lanes.on(mainline), outcome.driven
    return LaneUse(
        stays.vehicle,
        driven.first,
        driven.rows,
        traits,
        stays.from_s,
        stays.until_s,
        stays.merged,
    )
