"""What runs, studies and plans give back: records, tables, and their figures as methods."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Self

import polars as pl

from coramp.errors import CorampError
from coramp.explain.decision import quantities
from coramp.explain.quantity import Quantity
from coramp.explain.words import NOT_TOLD, tried_lines
from coramp.records.schemas import STREAM_ROWS
from coramp.report.plots import PlanPlots, RunPlots, StudyPlots
from coramp.report.short_texts import plan_text, run_text, study_text
from coramp.runs.corridors import broken_on_corridor
from coramp.runs.planning import PlannedSnapshot
from coramp.runs.running import RunSpec, broken_promises
from coramp.studies.tables import Table

if TYPE_CHECKING:
    import pandas as pd

    from coramp.report.style import Figure


@dataclass(frozen=True, repr=False)
class RunResult(RunPlots):
    """A run: its specification, its summary (the row of ``runs.parquet``) and its tables.

    ``frames`` are the tables by name: vehicles and speeds, violations, and positions, or
    trajectories and decisions if cooperative.
    """

    spec: RunSpec = field(kw_only=True)

    def __repr__(self) -> str:
        """Returns a few lines: what was run, what came of it, what there is to look at."""
        return run_text(self)

    @property
    def broken_promises(self) -> list[str]:
        """What a cooperative run promised and did not keep; empty where all is well."""
        return broken_promises(self.summary)

    def to_pandas(self) -> dict[str, "pd.DataFrame"]:
        """Returns the tables as pandas frames; needs pandas (``pip install coramp[pandas]``)."""
        return {name: as_pandas(frame) for name, frame in self.frames.items()}


@dataclass(frozen=True, repr=False)
class StudyResult(StudyPlots):
    """A study: one row a run, one row a run and stream, and the tables that sum them up.

    ``layout`` is what kind of study it is: plain, paper, sensitivity or capacity.
    """

    folder: Path
    runs: pl.DataFrame
    streams: pl.DataFrame
    tables: tuple[Table, ...]
    layout: str = "plain"

    def __repr__(self) -> str:
        """Returns a few lines: what was run, what came of it, what there is to look at."""
        return study_text(self.folder, self.runs, self.tables)

    @property
    def failed(self) -> pl.DataFrame:
        """The runs that failed, with their errors."""
        return self.runs.filter(status="failed")

    @property
    def broken_promises(self) -> list[str]:
        """What cooperative runs promised and did not keep, with their flows and seeds."""
        return [
            f"{row['strategy']}, {row['mainline_veh_h']:g} + {row['ramp_veh_h']:g} veh/h, "
            f"seed {row['seed']}: {'; '.join(broken)}"
            for row in self.runs.iter_rows(named=True)
            if (broken := broken_promises(row))
        ]

    def to_pandas(self) -> dict[str, "pd.DataFrame"]:
        """Returns the records as pandas frames; needs pandas (``pip install coramp[pandas]``)."""
        return {"runs": as_pandas(self.runs), "streams": as_pandas(self.streams)}


@dataclass(frozen=True, repr=False)
class CorridorStudyResult(StudyResult):
    """A corridor's study: one row a run, one row a run and site, and the tables that sum them up.

    There are no rows by stream; those of ``sites`` have the figures of both.
    """

    sites: pl.DataFrame = field(kw_only=True)

    @classmethod
    def of(
        cls, folder: Path, runs: pl.DataFrame, sites: pl.DataFrame, tables: tuple[Table, ...]
    ) -> Self:
        """Returns the result of a study in a folder."""
        return cls(folder, runs, pl.DataFrame(schema=STREAM_ROWS), tables, sites=sites)

    @property
    def broken_promises(self) -> list[str]:
        """What automated vehicles promised and did not keep, with settings and seeds."""
        return [
            f"{row['strategy']}, {row['overrides'] or 'as in the scenario'}, seed {row['seed']}: "
            f"{'; '.join(broken)}"
            for row in self.runs.filter(status="ok").iter_rows(named=True)
            if (broken := broken_on_corridor(row))
        ]

    def plot_delay(self, over: str | None = None) -> "Figure":
        """Returns the mean delay (s) of each strategy by site, with 95 % intervals over seeds.

        Raises CorampError where no run went well, and for ``over``: it is always by site.
        """
        from coramp.report.corridor_figures import study_delay_figure
        from coramp.report.study_folder import scenario_of

        if over not in (None, "site"):
            raise CorampError(f"over: {over}: a corridor's study is drawn by site; leave it out")
        return study_delay_figure(self._good(), self.sites, scenario_of(self.folder))

    def _repr_html_(self) -> str:
        """Returns how a notebook shows the study: its tables and its figure."""
        from coramp.report.page.notebook import corridor_study_html

        went_well = bool(self.runs.filter(status="ok").height)
        return corridor_study_html(self.tables, self.plot_delay() if went_well else None)

    def to_pandas(self) -> dict[str, "pd.DataFrame"]:
        """Returns the records as pandas frames; needs pandas (``pip install coramp[pandas]``)."""
        return {"runs": as_pandas(self.runs), "sites": as_pandas(self.sites)}


@dataclass(frozen=True, repr=False)
class PlanResult(PlanPlots):
    """Decisions on a snapshot, and all trajectories before and after them."""

    planned: PlannedSnapshot

    def __repr__(self) -> str:
        """Returns a few lines: what was planned, and what there is to look at."""
        return plan_text(self.planned)

    @property
    def decisions(self) -> pl.DataFrame:
        """One row a ramp vehicle, as in ``decisions.parquet``."""
        return self.planned.decisions

    @property
    def attempts(self) -> pl.DataFrame:
        """One row an attempt of a decision, as in ``attempts.parquet``."""
        return self.planned.attempts

    @property
    def trajectories(self) -> pl.DataFrame:
        """What every vehicle drives after the decisions, one row a piece."""
        return self.planned.after

    @property
    def before(self) -> pl.DataFrame:
        """What every vehicle would have driven; ramp vehicles stop before the nose."""
        return self.planned.before

    def quantities(self, vehicle_id: str) -> list[Quantity]:
        """Returns every intermediate quantity of a ramp vehicle's decision."""
        rows = self.decisions.filter(vehicle_id=vehicle_id)
        if rows.is_empty():
            known = ", ".join(self.decisions["vehicle_id"])
            raise CorampError(f"{vehicle_id}: was not planned; planned were {known}")
        attempts = self.attempts.filter(vehicle_id=vehicle_id).rows(named=True)
        return quantities(rows.row(0, named=True), attempts, self.planned.scenario.rules())

    def tried(self, vehicle_id: str) -> list[str]:
        """Returns what was tried for a ramp vehicle and why it was refused, line by line."""
        attempts = self.attempts.filter(vehicle_id=vehicle_id).rows(named=True)
        return tried_lines(attempts) or [NOT_TOLD]

    def to_pandas(self) -> dict[str, "pd.DataFrame"]:
        """Returns the records as pandas frames; needs pandas (``pip install coramp[pandas]``)."""
        return {
            "decisions": as_pandas(self.decisions),
            "trajectories": as_pandas(self.trajectories),
        }


def as_pandas(frame: pl.DataFrame) -> "pd.DataFrame":
    """Returns a polars frame as a pandas one, without pyarrow.

    Raises CorampError where pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError:
        raise CorampError("pandas is not installed; pip install pandas") from None
    return pd.DataFrame(
        {
            column.name: column.to_numpy() if column.dtype.is_float() else column.to_list()
            for column in frame
        }
    )
