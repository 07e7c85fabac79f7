"""Runs made by hand, as records."""

from coramp.agency.motion import motion_of
from coramp.metrics.tables import tables_of
from coramp.records.run import RunRecords
from tests.metrics import PAPER, outcome_of


def run_by_hand(cars, end_s, scenario=PAPER, **rest):
    """Returns the records of a run with these vehicles, who drove what was planned."""
    tables = tables_of(outcome_of(cars, end_s, cooperative=True, **rest), scenario)
    content = {
        "specification": scenario.model_dump(mode="json"),
        "strategy": "mainline-priority",
        "drivers": None,
        "mainline_veh_h": 0.0,
        "ramp_veh_h": 0.0,
        "settings": {},
    }
    summary = {**tables.metrics, "seed": 1, "engine": "exact", "strategy": "mainline-priority"}
    return RunRecords(content, summary, **tables.frames())


def motion_by_hand(cars, end_s, scenario=PAPER, **rest):
    """Returns the motion of such a run."""
    return motion_of(run_by_hand(cars, end_s, scenario, **rest))
