"""A run on three lanes, made by hand, in which one automated vehicle makes way."""

from dataclasses import replace

import polars as pl

from coramp.scenarios.model import Scenario
from tests.agency import run_by_hand
from tests.metrics import PAPER, Car

THREE = Scenario.model_validate(
    {
        **PAPER.model_dump(mode="json"),
        "mainline": {**PAPER.mainline.model_dump(mode="json"), "lanes": 3},
    },
    strict=False,
)
CHANGES_S = 20.0
CARS = [
    Car("m1", [(0.0, -400.0, 20.0, 0.0), (CHANGES_S, 0.0, 20.0, 0.0)], exit_s=40.0),
    Car("m2", [(0.0, -400.0, 20.0, 0.0)], exit_s=40.0),
    Car("m3", [(0.0, -400.0, 10.0, 0.0)], exit_s=80.0),
    Car("r1", [(0.0, -300.0, 15.0, 0.0)], merge_s=25.0, exit_s=46.0),
]
LANES = {
    ("m1", CHANGES_S): "mainline 2",
    ("m2", 0.0): "mainline 2",
    ("m3", 0.0): "mainline 3",
}
"""All others are as the road of one lane has them: m1 begins next to the ramp."""


def three_lanes():
    """Returns the records of the run."""
    run = run_by_hand(CARS, 80.0)
    named = [
        LANES.get((name, time_s), lane)
        for name, time_s, lane in run.trajectories.select("vehicle_id", "time_s", "lane").rows()
    ]
    return replace(
        run,
        content={
            **run.content,
            "specification": THREE.model_dump(mode="json"),
            "scenario": "three",
            "seed": 1,
        },
        summary={**run.summary, "drivers": None},
        vehicles=run.vehicles.with_columns(automated=pl.lit(value=True)),
        trajectories=run.trajectories.with_columns(lane=pl.Series(named)),
    )
