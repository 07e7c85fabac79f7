"""The records of one run: what was asked, its row, and its tables."""

from dataclasses import dataclass
from functools import cached_property

import polars as pl

from coramp.errors import CorampError
from coramp.records.schemas import Row
from coramp.scenarios.model import Scenario

TABLES = (
    "vehicles",
    "trajectories",
    "decisions",
    "speeds",
    "positions",
    "violations",
    "types",
    "attempts",
    "safety_events",
    "heard",
    "on_board",
)
"""Names of the tables of a run; a table that there is lies in NAME.parquet."""
MESSAGES = "messages"
"""The log of messages lies beside them where it was to be kept; only the audit reads it back."""


@dataclass(frozen=True)
class RunRecords:
    """What a run leaves, whether just made or read from its folder.

    ``content`` is what ``run.json`` holds, ``summary`` the row of ``runs.parquet``. There are
    trajectories and decisions only of cooperative runs, and positions of the others. Violations,
    positions, attempts and figures by type (of runs with several types) are None where a coramp
    that kept none wrote the run, messages where they were not to be kept, and in a run that was
    read. There are safety events of mixed traffic alone, what was heard where the world fails, and
    what was done on board where messages were kept.
    """

    content: Row
    summary: Row
    vehicles: pl.DataFrame
    speeds: pl.DataFrame
    trajectories: pl.DataFrame | None = None
    decisions: pl.DataFrame | None = None
    positions: pl.DataFrame | None = None
    violations: pl.DataFrame | None = None
    messages: pl.DataFrame | None = None
    types: pl.DataFrame | None = None
    attempts: pl.DataFrame | None = None
    safety_events: pl.DataFrame | None = None
    heard: pl.DataFrame | None = None
    on_board: pl.DataFrame | None = None

    @property
    def frames(self) -> dict[str, pl.DataFrame]:
        """The tables that there are, by name."""
        every = {name: getattr(self, name) for name in (*TABLES, MESSAGES)}
        return {name: frame for name, frame in every.items() if frame is not None}

    @cached_property
    def attempts_of(self) -> dict[tuple[str, float], list[Row]]:
        """What was tried, in order, by vehicle and time of the decision; empty if not kept."""
        found: dict[tuple[str, float], list[Row]] = {}
        for row in [] if self.attempts is None else self.attempts.rows(named=True):
            found.setdefault((row["vehicle_id"], row["time_s"]), []).append(row)
        return found

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario that was run."""
        return Scenario.model_validate(self.content["specification"], strict=False)

    @property
    def is_mixed(self) -> bool:
        """Whether automated vehicles drove among drivers."""
        columns = self.vehicles.columns
        return "automated" in columns and self.vehicles["automated"].n_unique() == 2

    @property
    def is_unplanned(self) -> bool:
        """Whether automated vehicles drove without plans: among drivers, or in a world that fails.

        Drivers alone have events of such a world too.
        """
        return self.safety_events is not None and self.summary["automated_vehicles"] is not None

    @property
    def flows(self) -> str:
        """The flows in words."""
        return f"{self.content['mainline_veh_h']:g} + {self.content['ramp_veh_h']:g} veh/h"

    @property
    def motion(self) -> pl.DataFrame:
        """Where vehicles were: trajectories of a cooperative run, positions of any other.

        Raises CorampError where there are none, as in runs of a coramp that kept none.
        """
        found = self.trajectories if self.trajectories is not None else self.positions
        if found is None:
            raise CorampError(
                "the run does not tell where vehicles were: an older coramp wrote it; run it again"
            )
        return found

    def vehicle(self, vehicle_id: str) -> Row:
        """Returns a vehicle's row; raises CorampError where there is none such."""
        found = self.vehicles.filter(vehicle_id=vehicle_id)
        if found.is_empty():
            known = sorted(self.vehicles["vehicle_id"].to_list())
            allowed = f"allowed are {known[0]} to {known[-1]}" if known else "no vehicle arrived"
            raise CorampError(f"there is no vehicle {vehicle_id!r}; {allowed}")
        return found.row(0, named=True)

    def coordinated(self, what: str) -> tuple[pl.DataFrame, pl.DataFrame]:
        """Returns trajectories and decisions; ``what`` is what they are wanted for, as a verb.

        Raises CorampError for a run in which nobody was coordinated, or where one is lost.
        """
        if self.is_unplanned:
            raise CorampError(
                f"vehicles among drivers drive without plans, so that there is none to {what}; "
                f"{what} a run of automated vehicles alone"
            )
        if self.trajectories is None and self.decisions is None:
            raise CorampError(f"no vehicle was coordinated in this run; {what} a cooperative one")
        if self.trajectories is None or self.decisions is None:
            raise CorampError("is not complete; run again with the same --out")
        return self.trajectories, self.decisions


def moved_for(decisions: pl.DataFrame, vehicle_id: str) -> list[Row]:
    """Returns the decisions about others that moved a vehicle aside or braked it."""
    moved = pl.col("adjusted_vehicle_ids").list.contains(vehicle_id).fill_null(value=False)
    return decisions.filter(moved).rows(named=True)
