"""What must follow a change of a dial, so that a slider does not run into the scenario's checks."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from coramp.equations.gaps import least_acceleration_mps2
from coramp.road.streams import STREAMS
from coramp.scenarios.checks import decision_station_range_m
from coramp.scenarios.model import Scenario


def following(scenario: Scenario, changed: Mapping[str, float]) -> Iterator[tuple[str, Any]]:
    """Yields keys of the scenario and the values that they take when others were ``changed``.

    Entry speeds and limits keep their ratio to the speed of their stream. The decision station and
    the ordinary acceleration move no further than the changed road asks (Eq. 22).
    """
    for stream in STREAMS:
        speed_mps = changed.get(f"{stream}.speed_mps")
        if speed_mps is None:
            continue
        own = getattr(scenario, stream)
        ratio = speed_mps / own.speed_mps
        yield f"{stream}.limit_mps", round(own.limit_mps * ratio, 6)
        low, high = own.entry_speed_mps
        yield f"{stream}.entry_speed_mps", [round(low * ratio, 6), round(high * ratio, 6)]
    road = {"mainline.speed_mps", "ramp.speed_mps", "ramp.acceleration_lane_m"}
    if road & changed.keys():
        yield from _planning(scenario, changed)


def _planning(scenario: Scenario, changed: Mapping[str, float]) -> Iterator[tuple[str, Any]]:
    v0 = changed.get("mainline.speed_mps", scenario.mainline.speed_mps)
    ramp_mps = changed.get("ramp.speed_mps", scenario.ramp.speed_mps)
    lane_m = changed.get("ramp.acceleration_lane_m", scenario.ramp.acceleration_lane_m)
    if ramp_mps >= v0:
        return
    ratio = ramp_mps / scenario.ramp.speed_mps
    mainline = scenario.mainline.model_copy(update={"speed_mps": v0})
    ramp = scenario.ramp.model_copy(
        update={
            "speed_mps": ramp_mps,
            "limit_mps": scenario.ramp.limit_mps * ratio,
            "acceleration_lane_m": lane_m,
        }
    )
    road = scenario.model_copy(update={"mainline": mainline, "ramp": ramp})
    if road.last_merge_station_m <= 0.0:
        return
    first_m, last_m = decision_station_range_m(road)
    own_m = scenario.ramp.decision_station_m
    if own_m is not None and first_m <= last_m and not first_m <= own_m <= last_m:
        inside = (
            math.ceil(10.0 * first_m) / 10.0 if own_m < first_m else math.floor(10 * last_m) / 10
        )
        yield "ramp.decision_station_m", inside
    least = least_acceleration_mps2(v0, ramp_mps, road.last_merge_station_m)
    own_mps2 = scenario.motion.free_acceleration_mps2
    if own_mps2 < least <= scenario.motion.ramp_acceleration_mps2:
        yield "motion.free_acceleration_mps2", math.ceil(1000.0 * least) / 1000.0
