"""Virtual loops on the road: what induction loops of SUMO would have counted, from trajectories.

Each loop is a point of one lane; a mainline of several lanes has one on each. A vehicle counts when
its front passes, and has passed when its rear does; meanwhile it occupies the loop.
"""

from typing import NamedTuple

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray
from coramp.agency.edie import overlap_s, ratio
from coramp.agency.intervals import edges_of
from coramp.agency.level_of_service import is_heavy
from coramp.agency.motion import Motion, Passings, passings
from coramp.agency.schemas import DETECTORS
from coramp.metrics.frames import frame_of
from coramp.metrics.queues import INTERVAL_S, loop_station_m
from coramp.networks.stations import Place, stations_of
from coramp.road.lanes import MAINLINE, RAMP
from coramp.scenarios.model import Scenario
from coramp.vehicles.traits import LENGTH
from coramp.worlds.sumo.lanes import site_of_road
from coramp.worlds.sumo.network import RAMP_LANES, road_plan

FROM_START_M, FROM_END_M = 10.0, 30.0
"""How far the first loops are from where vehicles enter, and the last one from where they leave."""


class Detector(NamedTuple):
    """A loop: a place on the mainline, or on the ramp with its acceleration lane.

    ``number`` is the lane of the mainline, 0 next to the ramp, None on the ramp. ``lane`` and
    ``position_m`` say the same of SUMO's network. ``kind`` is what routers call it:
    source, between or sink; none where some vehicles pass beside it, on the acceleration lane.
    """

    name: str
    number: int | None
    station_m: float
    lane: str
    position_m: float
    kind: str

    @property
    def on_mainline(self) -> bool:
        """Whether it is on the mainline."""
        return self.number is not None


def detectors_of(scenario: Scenario) -> list[Detector]:
    """Returns the loops: where both streams enter, upstream, beside the acceleration lane, behind.

    The one upstream is where breakdowns are told, the one at the merge where ramps are metered. Of
    several lanes each has its own, named by its number, 1 next to the ramp.
    """
    mainline, ramp = scenario.mainline, scenario.ramp
    places = (
        ("mainline_in", True, mainline.start_m + FROM_START_M, "source"),
        ("mainline_upstream", True, loop_station_m(scenario), "between"),
        ("ramp_in", False, ramp.start_m + FROM_START_M, "source"),
        ("mainline_merge", True, scenario.detector_station_m, ""),
        ("mainline_out", True, mainline.end_m - FROM_END_M, "sink"),
    )
    many, found = mainline.lanes > 1, []
    for name, on_mainline, station_m, kind in places:
        for number in range(mainline.lanes) if on_mainline else (None,):
            own = f"{name}_{number + 1}" if many and number is not None else name
            lane, position_m = _lane_at(scenario, number, station_m)
            found.append(Detector(own, number, station_m, lane, position_m, kind))
    return found


def _lane_at(scenario: Scenario, number: int | None, station_m: float) -> tuple[str, float]:
    """The lane of SUMO's network at a station, and the position (m) on it."""
    site = site_of_road(scenario)
    if site is not None:
        code, lane = (RAMP, 0) if number is None else (MAINLINE, number)
        return stations_of(site).position(Place(station_m, code, lane))
    plan, on_mainline = road_plan(scenario), number is not None
    starts_m = plan.lane_starts_m()
    here = {
        lane: station_m - starts_m[lane]
        for lane, length_m in plan.lane_lengths_m().items()
        if (lane not in RAMP_LANES) == on_mainline
        and starts_m[lane] <= station_m < starts_m[lane] + length_m
    }
    return min(here.items(), key=lambda pair: pair[1])


def detectors_table(motion: Motion, interval_s: float = INTERVAL_S) -> pl.DataFrame:
    """Returns one row a loop and interval, with the columns of ``DETECTORS``."""
    edges_s = edges_of(motion, interval_s)
    return pl.concat([_rows(motion, d, edges_s) for d in detectors_of(motion.scenario)])


def _rows(motion: Motion, detector: Detector, edges_s: FloatArray) -> pl.DataFrame:
    fronts = _fronts(motion, detector)
    length_m = motion.traits[:, LENGTH]
    bins = len(edges_s) - 1
    place = np.clip(np.searchsorted(edges_s, fronts.time_s, "right") - 1, 0, bins - 1)
    rear_s = _rear_s(motion, detector)
    over_s = np.minimum(rear_s[fronts.vehicle], motion.until_s[fronts.vehicle])
    occupied_s = overlap_s(fronts.time_s, over_s, edges_s).sum(axis=0)
    known_s = rear_s[~np.isinf(rear_s)]
    gone = np.clip(np.searchsorted(edges_s, known_s, "right") - 1, 0, bins - 1)
    heavy = is_heavy(motion)[fronts.vehicle]

    def summed(values: FloatArray, chosen: BoolArray | slice = slice(None)) -> FloatArray:
        return np.bincount(place[chosen], values[chosen], minlength=bins).astype(np.float64)

    ones, slowness = np.ones(len(place)), ratio(np.ones(len(place)), fronts.speed_mps, np.inf)
    counts, trucks = summed(ones), summed(ones, heavy)
    return frame_of(
        DETECTORS,
        detector=[detector.name] * bins,
        lane=[detector.lane] * bins,
        position_m=[detector.position_m] * bins,
        station_m=[detector.station_m] * bins,
        from_s=edges_s[:-1],
        to_s=edges_s[1:],
        vehicles=counts.astype(np.int64),
        trucks=trucks.astype(np.int64),
        passed=np.bincount(gone, minlength=bins),
        flow_veh_h=counts * 3600.0 / np.diff(edges_s),
        occupancy_percent=100.0 * occupied_s / np.diff(edges_s),
        mean_speed_mps=ratio(summed(fronts.speed_mps), counts),
        harmonic_speed_mps=ratio(counts, summed(slowness)),
        car_speed_mps=ratio(summed(fronts.speed_mps, ~heavy), counts - trucks),
        truck_speed_mps=ratio(summed(fronts.speed_mps, heavy), trucks),
        mean_length_m=ratio(summed(length_m[fronts.vehicle]), counts),
    )


def _fronts(motion: Motion, detector: Detector) -> Passings:
    return passings(motion, detector.on_mainline, detector.station_m, detector.number)


def _rear_s(motion: Motion, detector: Detector) -> FloatArray:
    """When each vehicle's rear passes the loop (s), infinite where it does not.

    It may have changed lanes, or reached the next road, since its front passed.
    """
    rear_m = detector.station_m + motion.traits[:, LENGTH]
    found_s = np.full(len(motion), np.inf)
    for on_mainline in (False, True):
        vehicle, time_s, _ = passings(motion, on_mainline, rear_m)
        found_s[vehicle] = np.minimum(found_s[vehicle], time_s)
    fronts = _fronts(motion, detector).vehicle
    counted = np.zeros(len(motion), np.bool_)
    counted[fronts] = True
    return np.where(counted, found_s, np.inf)
