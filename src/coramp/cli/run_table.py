"""The summary of a run as the terminal shows it."""

from coramp.records.schemas import Row
from coramp.road.streams import STREAMS
from coramp.studies.metric_labels import LABELS, RUNG_COLUMNS, in_unit, label_of
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.tables import Table, number

BOUND = ("delay_bound_s", "delay_bound_ratio")


def run_table(summary: Row, unit: SpeedUnit = MPS) -> Table:
    """Returns the summary of a run as a table of two columns; speeds in a unit."""
    who = f"{summary['strategy']}"
    if summary["drivers"]:
        who += f", {summary['drivers']} drivers"

    def text(*columns: str) -> str:
        return ", ".join(
            number(in_unit(summary[column], column, unit), LABELS[column].digits)
            for column in columns
        )

    def named(*columns: str) -> str:
        return ", ".join(label_of(column, unit) for column in columns)

    def alike(*columns: str) -> tuple[str, str]:
        return named(*columns), text(*columns)

    lines = [
        (f"{named('delay_s')}: mean", text("delay_s")),
        *([alike(*BOUND), alike("lane_limit_veh_h")] if summary["lane_limit_veh_h"] else []),
        *(
            (
                f"{named(f'{stream}_delay_s')}: mean, 95th percentile",
                text(f"{stream}_delay_s", f"{stream}_delay_p95_s"),
            )
            for stream in STREAMS
        ),
        *(
            (
                f"{named(f'{stream}_speed_mps')}: mean, over 1 s bins ±",
                text(f"{stream}_speed_mps", f"{stream}_speed_std_mps"),
            )
            for stream in STREAMS
        ),
        alike("vehicles_mainline", "vehicles_ramp", "unserved"),
        alike("fuel_l"),
        alike("collisions", "safety_violations"),
        (named("min_margin_m"), _margin(summary)),
        alike("min_ttc_s", "max_drac_mps2"),
        alike("max_severity", "max_decel_mps2"),
        alike("hard_brakings_3", "hard_brakings_4_5"),
        alike("stops"),
    ]
    if summary["drivers"] is None:
        lines += [alike("plan_error_m"), alike("interventions")]
        if any(summary[column] for column in RUNG_COLUMNS.values()):
            by_rung = ", ".join(f"{rung} {summary[c]}" for rung, c in RUNG_COLUMNS.items())
            lines += [("ramp vehicles by rung", by_rung), alike("adjusted_vehicles")]
    lines.append(alike("wall_s"))
    title = (
        f"{summary['scenario']}: {who}, {summary['mainline_veh_h']:g} + {summary['ramp_veh_h']:g} "
        f"veh/h, seed {summary['seed']}"
    )
    return Table(title, ("what", "value"), tuple(lines))


def _margin(summary: Row) -> str:
    """The least margin, with its equation where that is not Eq. 1."""
    equation = summary["min_margin_equation"]
    over = f", over Eq. {equation}" if equation not in (None, 1) else ""
    return f"{number(summary['min_margin_m'], 3)}{over}"
