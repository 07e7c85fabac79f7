"""Which detectors of a merge say what: who comes, where the queue stands, what leaves."""

from collections.abc import Sequence
from dataclasses import dataclass

from coramp.errors import CorampError
from coramp.metrics.queues import LOOP_M
from coramp.scenarios.demand_sections import Detector


@dataclass(frozen=True)
class Site:
    """The detectors of a merge.

    ``mainline_entry`` and ``ramp_entry`` count who comes; at ``upstream``, on the mainline before
    the nose, a queue is seen; ``downstream``, behind the acceleration lane, counts what leaves.
    """

    loops: tuple[Detector, ...]
    mainline_entry: Detector
    ramp_entry: Detector
    upstream: Detector
    downstream: Detector

    @property
    def settled(self) -> tuple[Detector, ...]:
        """The detectors whose speeds tell of drivers: not those where vehicles have just entered.

        That at which a queue is seen counts in any case.
        """
        entries = self.mainline_entry, self.ramp_entry
        return tuple(loop for loop in self.loops if loop == self.upstream or loop not in entries)


def site_of(loops: Sequence[Detector], acceleration_lane_m: float) -> Site:
    """Returns what detectors of a merge are for.

    Raises CorampError where one is missing that calibration needs.
    """
    before = [loop for loop in loops if loop.road == "mainline" and loop.station_m <= 0.0]
    behind = [
        loop for loop in loops if loop.road == "mainline" and loop.station_m >= acceleration_lane_m
    ]
    ramp = [loop for loop in loops if loop.road == "ramp" and loop.station_m <= 0.0]
    missing = [
        place
        for found, place in (
            (before, "on the mainline before the nose"),
            (ramp, "on the ramp before the nose"),
            (behind, f"on the mainline at {acceleration_lane_m:g} m or further"),
        )
        if not found
    ]
    if missing:
        raise CorampError(
            f"detectors: none lies {' or '.join(missing)}; calibration needs one at each place"
        )

    def station_m(loop: Detector) -> float:
        return loop.station_m

    return Site(
        tuple(loops),
        min(before, key=station_m),
        min(ramp, key=station_m),
        min(before, key=lambda loop: abs(loop.station_m - LOOP_M)),
        min(behind, key=station_m),
    )
