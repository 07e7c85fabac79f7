"""The summary of a run as the terminal shows it."""

from collections.abc import Iterator
from dataclasses import dataclass

from coramp.records.schemas import Row
from coramp.road.streams import STREAMS
from coramp.studies.metric_labels import LABELS, RUNG_COLUMNS, in_unit, label_of
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.tables import Table, number

BOUND = ("delay_bound_s", "delay_bound_ratio")
OF_KINDS = (
    "automated_hard_brakings_3",
    "driver_hard_brakings_3",
    "collisions_by_automated",
    "collisions_by_driver",
    "collisions_among_drivers",
    "broken_assumptions",
    "automated_violations",
)
"""Columns of runs in which automated vehicles drive among drivers, a line each."""


@dataclass(frozen=True)
class _Figures:
    """The figures of a run as texts, by columns of its row; speeds in a unit."""

    summary: Row
    unit: SpeedUnit

    def text(self, *columns: str) -> str:
        """Returns the values of columns."""
        return ", ".join(
            number(in_unit(self.summary[column], column, self.unit), LABELS[column].digits)
            for column in columns
        )

    def named(self, *columns: str) -> str:
        """Returns the names of columns, with their units."""
        return ", ".join(label_of(column, self.unit) for column in columns)

    def alike(self, *columns: str) -> tuple[str, str]:
        """Returns a line of columns that are shown side by side."""
        return self.named(*columns), self.text(*columns)


def run_table(summary: Row, unit: SpeedUnit = MPS) -> Table:
    """Returns the summary of a run as a table of two columns; speeds in a unit."""
    figures = _Figures(summary, unit)
    lines = [
        *_traffic_lines(figures),
        *_safety_lines(figures),
        *(_kind_lines(figures) if summary["automated_vehicles"] is not None else ()),
        *(_plan_lines(figures) if summary["drivers"] is None else ()),
        figures.alike("wall_s"),
    ]
    who = f"{summary['strategy']}"
    if summary["drivers"]:
        who += f", {summary['drivers']} drivers"
    title = (
        f"{summary['scenario']}: {who}, {summary['mainline_veh_h']:g} + {summary['ramp_veh_h']:g} "
        f"veh/h, seed {summary['seed']}"
    )
    return Table(title, ("what", "value"), tuple(lines))


def _traffic_lines(figures: _Figures) -> Iterator[tuple[str, str]]:
    """Delay and speed of all and of the streams, and how many vehicles there were."""
    yield f"{figures.named('delay_s')}: mean", figures.text("delay_s")
    if figures.summary["lane_limit_veh_h"]:
        yield figures.alike(*BOUND)
        yield figures.alike("lane_limit_veh_h")
    for stream in STREAMS:
        name = f"{figures.named(f'{stream}_delay_s')}: mean, 95th percentile"
        yield name, figures.text(f"{stream}_delay_s", f"{stream}_delay_p95_s")
    for stream in STREAMS:
        name = f"{figures.named(f'{stream}_speed_mps')}: mean, over 1 s bins ±"
        yield name, figures.text(f"{stream}_speed_mps", f"{stream}_speed_std_mps")
    if figures.summary["outer_lane_delay_s"] is not None:
        yield figures.alike("outer_lane_delay_s")
    if figures.summary["made_way"] is not None:
        yield figures.alike("made_way")
    yield figures.alike("vehicles_mainline", "vehicles_ramp", "unserved")
    yield figures.alike("fuel_l")


def _safety_lines(figures: _Figures) -> Iterator[tuple[str, str]]:
    """How near vehicles came, and how hard they braked."""
    yield figures.alike("collisions", "safety_violations")
    yield figures.named("min_margin_m"), _margin(figures.summary)
    yield figures.alike("min_ttc_s", "max_drac_mps2")
    yield figures.alike("max_severity", "max_decel_mps2")
    yield figures.alike("hard_brakings_3", "hard_brakings_4_5")
    yield figures.alike("stops")


def _kind_lines(figures: _Figures) -> Iterator[tuple[str, str]]:
    """What automated vehicles and drivers among one another got, and who broke what."""
    yield figures.alike("automated_vehicles", "ramp_stops")
    yield figures.alike("automated_delay_s", "driver_delay_s")
    for column in OF_KINDS:
        yield figures.alike(column)
    if figures.summary["plan_error_m"] is not None:
        yield figures.alike("plan_error_m")


def _plan_lines(figures: _Figures) -> Iterator[tuple[str, str]]:
    """How plans were kept and made, where all vehicles were planned."""
    summary = figures.summary
    yield figures.alike("plan_error_m")
    yield figures.alike("interventions")
    if any(summary[column] for column in RUNG_COLUMNS.values()):
        counts = {rung: summary[column] for rung, column in RUNG_COLUMNS.items()}
        if summary.get("made_way") is not None:
            counts["make way"] = summary["made_way"]
        by_rung = ", ".join(f"{rung} {count}" for rung, count in counts.items())
        yield "ramp vehicles by rung", by_rung
        yield figures.alike("adjusted_vehicles")


def _margin(summary: Row) -> str:
    """The least margin, with its equation where that is not Eq. 1."""
    equation = summary["min_margin_equation"]
    over = f", over Eq. {equation}" if equation not in (None, 1) else ""
    return f"{number(summary['min_margin_m'], 3)}{over}"
