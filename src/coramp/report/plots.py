"""The figures that results have as methods; matplotlib is imported at the first of them."""

from pathlib import Path
from typing import TYPE_CHECKING

import polars as pl

from coramp.errors import CorampError
from coramp.records.run import RunRecords
from coramp.runs.planning import PlannedSnapshot
from coramp.studies.tables import Table

if TYPE_CHECKING:
    from coramp.report.style import Figure


class RunPlots(RunRecords):
    """The records of one run, and its figures."""

    def plot_time_space(
        self, from_s: float | None = None, until_s: float | None = None
    ) -> "Figure":
        """Returns the time-space diagram of all vehicles: station (m) over time (s).

        From ``from_s`` (default: 0) until ``until_s`` (default: 120 s later). Raises CorampError
        for an empty window.
        """
        from coramp.report.time_space_figure import run_time_space_figure

        return run_time_space_figure(self, from_s, until_s)

    def plot_speeds(self) -> "Figure":
        """Returns the mean speed (m/s) of mainline and ramp over time (s).

        Faint lines are bins of 1 s, bold ones means over a minute.
        """
        from coramp.report.run_figures import both_speeds_figure

        return both_speeds_figure(self)

    def plot_decision(self, vehicle_id: str) -> "Figure":
        """Returns the road at a vehicle's decision and the time-space diagram around it.

        Its last decision that gave a merge, else its last, else the last that moved it for
        another; without any, its own passage. Raises CorampError for an uncontrolled run, and for
        a vehicle that is not there or never entered.
        """
        from coramp.report.story_figure import story_figure

        return story_figure(self, vehicle_id)

    def _repr_html_(self) -> str:
        """Returns how a notebook shows the run: summary, replay and time-space diagram."""
        from coramp.report.page.notebook import run_html

        return run_html(self)


class PlanPlots:
    """The figure of a plan."""

    planned: PlannedSnapshot

    def plot_time_space(self) -> "Figure":
        """Returns station (m) over time (s) of every vehicle, before the decisions and after."""
        from coramp.report.plan_figure import plan_figure

        return plan_figure(self.planned)

    def _repr_html_(self) -> str:
        """Returns how a notebook shows the plan: decisions, before and after."""
        from coramp.report.page.notebook import plan_html

        return plan_html(self.planned)


class StudyPlots:
    """The figures of a study; but for ``plot_delay`` each needs the layout of its runs."""

    folder: Path
    runs: pl.DataFrame
    tables: tuple[Table, ...]
    layout: str

    def _repr_html_(self) -> str:
        """Returns how a notebook shows the study: its tables and figures."""
        from coramp.report.page.notebook import study_html

        return study_html(self.tables, self.layout, self.runs)

    def plot_delay(self, over: str | None = None) -> "Figure":
        """Returns mean delay (s) over what varies, with 95 % intervals over seeds.

        ``over`` is ``flow``, ``strategy`` or a dotted key that the study sets; left out, it is the
        first that varies, and a study with the layout ``paper`` has a figure of its own. Below the
        delays stand the differences between strategies, seed by seed on the same arrivals. Raises
        CorampError for what does not vary, and where no run went well.
        """
        if over is None and self.layout == "paper":
            from coramp.report.flow_figures import delay_figure

            return delay_figure(self._good())
        from coramp.report.study_folder import scenario_of
        from coramp.report.varied_figure import varied_figure

        return varied_figure(self._good(), over, scenario_of(self.folder))

    def plot_gain(self) -> "Figure":
        """Returns the delay (%) that cooperation saves against both populations of drivers.

        Raises CorampError for a study whose layout is not ``paper``, and where no run went well.
        """
        from coramp.report.flow_figures import gain_figure

        return gain_figure(self._drawn("paper"))

    def plot_rungs(self) -> "Figure":
        """Returns the share (%) of merges that each rung gave, by flow.

        Raises CorampError for a study whose layout is not ``paper``, and where no run went well.
        """
        from coramp.report.flow_figures import rung_figure

        return rung_figure(self._drawn("paper"))

    def plot_sensitivity(self) -> "Figure":
        """Returns mean delay (s) over each setting that varies, with 95 % intervals over seeds.

        Raises CorampError for a study whose layout is not ``sensitivity``, where no run went well
        and where no setting varies.
        """
        from coramp.report.sensitivity_figure import sensitivity_figure, settings_of

        runs = self._drawn("sensitivity")
        if not settings_of(runs):
            raise CorampError(f"{self.folder}: no setting varies alone; there is nothing to plot")
        return sensitivity_figure(runs)

    def plot_capacity(self) -> "Figure":
        """Returns the mainline flow (veh/h) at which merging breaks down, over ramp flow (veh/h).

        Raises CorampError for a study whose layout is not ``capacity``, and where no run went well.
        """
        from coramp.report.capacity_figure import capacity_figure

        return capacity_figure(self._drawn("capacity"))

    def plot_field(self) -> "Figure":
        """Returns every strategy's main figures, with 95 % intervals over seeds.

        Raises CorampError for a study whose layout is not ``field``, and where no run went well.
        """
        from coramp.report.field_figure import field_figure

        return field_figure(self._drawn("field"))

    def plot_front(self) -> "Figure":
        """Returns delay (s) against fuel (ml/vehicle) of every strategy, and the Pareto front.

        Raises CorampError for a study whose layout is not ``field``, and where no run went well.
        """
        from coramp.report.front_figure import front_figure

        return front_figure(self._drawn("field"))

    def plot_baseline(self) -> "Figure":
        """Returns delays (s) of each baseline, and of equal time gaps without and with a plan.

        Raises CorampError for a study whose layout is not ``baseline``, and where no run went well.
        """
        from coramp.report.baseline_figure import baseline_figure

        return baseline_figure(self._drawn("baseline"))

    def plot_penetration(self) -> "Figure":
        """Returns delay (s) and hard braking over the share (%) of automated vehicles, by demand.

        Raises CorampError for a study whose layout is not ``penetration``, and where no run went
        well.
        """
        from coramp.report.penetration_figure import penetration_figure

        return penetration_figure(self._drawn("penetration"))

    def plot_hostile(self) -> "Figure":
        """Returns delay (% of that in a perfect world) and conflicts by fault, share and demand.

        Raises CorampError for a study whose layout is not ``hostile``, and where no run went well.
        """
        from coramp.report.hostile_figure import hostile_figure

        return hostile_figure(self._drawn("hostile"))

    def _drawn(self, layout: str) -> pl.DataFrame:
        """The runs that went well, of a study that has this layout."""
        if self.layout != layout:
            raise CorampError(
                f"{self.folder}: the study's layout is {self.layout}; this figure is of studies "
                f"with the layout {layout}"
            )
        return self._good()

    def _good(self) -> pl.DataFrame:
        """The runs that went well."""
        good = self.runs.filter(status="ok")
        if good.is_empty():
            raise CorampError(f"{self.folder}: no run went well; there is nothing to plot")
        return good
