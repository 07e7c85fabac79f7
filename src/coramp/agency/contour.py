"""Flow, density and speed over time and road, in cells of 30 s and 50 m."""

import math
from typing import NamedTuple

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
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
    """A road from station to station (m), its lanes, and the speed (m/s) of free flow."""

    name: str
    start_m: float
    end_m: float
    lanes: int
    free_mps: float

    @property
    def is_mainline(self) -> bool:
        """Whether it is the mainline."""
        return self.name == MAINLINE_ROAD


def road_of(scenario: Scenario, name: str) -> Road:
    """Returns one of the two roads of a scenario."""
    mainline, ramp = scenario.mainline, scenario.ramp
    if name == MAINLINE_ROAD:
        return Road(name, mainline.start_m, mainline.end_m, 1, mainline.speed_mps)
    return Road(name, ramp.start_m, ramp.acceleration_lane_m, 1, ramp.speed_mps)


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
    road = road_of(motion.scenario, name)
    edges_s = np.arange(max(1, math.ceil(motion.end_s / cell_s - 1e-9)) + 1.0) * cell_s
    inner_m = np.arange(math.ceil((road.end_m - road.start_m) / cell_m - 1e-9)) * cell_m
    edges_m = np.append(road.start_m + inner_m, road.end_m).astype(np.float64)
    on_road = motion.on_mainline == road.is_mainline
    return Cells(road, edges_s, edges_m, spent_in_cells(motion, on_road, edges_s, edges_m))


def contour_table(motion: Motion) -> pl.DataFrame:
    """Returns one row a cell in which there were vehicles, with the columns of ``CONTOUR``."""
    return pl.concat([_rows(cells_of(motion, name)) for name in ROADS])


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
