"""Flow, density and speed over time and road, in cells of 30 s and 50 m.

Where the mainline has several lanes, ``mainline`` is all of them together, and ``mainline 1`` (next
to the ramp), ``mainline 2`` and so on are each one of them.
"""

import math
from typing import NamedTuple

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray
from coramp.agency.edie import Spent, ratio, spent_in_cells
from coramp.agency.motion import Motion
from coramp.agency.schemas import CONTOUR
from coramp.metrics.frames import frame_of
from coramp.scenarios.model import Scenario

CELL_S, CELL_M = 30.0, 50.0
MAINLINE_ROAD, RAMP_ROAD = "mainline", "ramp"
ROADS = (MAINLINE_ROAD, RAMP_ROAD)
"""What vehicles are on; the acceleration lane belongs to the ramp's."""


class Road(NamedTuple):
    """A road from station to station (m), its lanes, and the speed (m/s) of free flow.

    ``lane`` is set where it is one of several lanes of the mainline alone, 0 next to the ramp.
    """

    name: str
    start_m: float
    end_m: float
    lanes: int
    free_mps: float
    lane: int | None = None

    @property
    def is_mainline(self) -> bool:
        """Whether it is the mainline, or a lane of it."""
        return self.name != RAMP_ROAD

    def pieces(self, motion: Motion) -> BoolArray:
        """Returns which pieces of a motion are on it."""
        whole = self.lane is None
        return np.asarray(
            motion.on_mainline == self.is_mainline if whole else motion.lane == self.lane, np.bool_
        )


def road_of(scenario: Scenario, name: str) -> Road:
    """Returns one of the two roads of a scenario, the mainline with all of its lanes."""
    mainline, ramp = scenario.mainline, scenario.ramp
    if name == MAINLINE_ROAD:
        return Road(name, mainline.start_m, mainline.end_m, mainline.lanes, mainline.speed_mps)
    return Road(name, ramp.start_m, ramp.acceleration_lane_m, 1, ramp.speed_mps)


def lanes_of(scenario: Scenario) -> list[Road]:
    """Returns each lane of the mainline as a road of its own; none where there is one alone."""
    whole = road_of(scenario, MAINLINE_ROAD)
    if whole.lanes == 1:
        return []
    return [
        whole._replace(name=f"{whole.name} {lane + 1}", lanes=1, lane=lane)
        for lane in range(whole.lanes)
    ]


class Cells(NamedTuple):
    """What vehicles spend in the cells of a road, between edges of time and station."""

    road: Road
    edges_s: FloatArray
    edges_m: FloatArray
    spent: Spent

    @property
    def speed_mps(self) -> FloatArray:
        """The mean speed in each cell, by interval and stretch; nan where nobody was."""
        return ratio(self.spent.way_m, self.spent.time_s)


def cells_of(motion: Motion, name: str, cell_s: float = CELL_S, cell_m: float = CELL_M) -> Cells:
    """Returns the cells of a road; those at its end may be shorter, none is longer."""
    return cells_on(motion, road_of(motion.scenario, name), cell_s, cell_m)


def cells_on(motion: Motion, road: Road, cell_s: float = CELL_S, cell_m: float = CELL_M) -> Cells:
    """Returns the cells of a road, or of a lane as a road of its own."""
    edges_s = np.arange(max(1, math.ceil(motion.end_s / cell_s - 1e-9)) + 1.0) * cell_s
    inner_m = np.arange(math.ceil((road.end_m - road.start_m) / cell_m - 1e-9)) * cell_m
    edges_m = np.append(road.start_m + inner_m, road.end_m).astype(np.float64)
    spent = spent_in_cells(motion, road.pieces(motion), edges_s, edges_m)
    return Cells(road, edges_s, edges_m, spent)


def contour_table(motion: Motion) -> pl.DataFrame:
    """Returns one row a cell in which there were vehicles, with the columns of ``CONTOUR``."""
    roads = [*(road_of(motion.scenario, name) for name in ROADS), *lanes_of(motion.scenario)]
    return pl.concat([_rows(cells_on(motion, road)) for road in roads])


def _rows(cells: Cells) -> pl.DataFrame:
    time_s, way_m = cells.spent
    area = np.diff(cells.edges_s)[:, None] * np.diff(cells.edges_m)[None, :]
    when, where = np.nonzero(time_s > 0.0)
    at = (when, where)
    return frame_of(
        CONTOUR,
        road=[cells.road.name] * len(when),
        time_s=cells.edges_s[when],
        station_m=cells.edges_m[where],
        flow_veh_h=(way_m / area)[at] * 3600.0,
        density_veh_km=(time_s / area)[at] * 1000.0,
        mean_speed_mps=cells.speed_mps[at],
    )
