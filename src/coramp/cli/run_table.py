"""The summary of a run as the terminal shows it."""

from coramp.records.schemas import Row
from coramp.strategies.situation import RUNGS
from coramp.studies.tables import Table, number


def run_table(summary: Row) -> Table:
    """Returns the summary of a run as a table of two columns."""
    who = f"{summary['strategy']}"
    if summary["drivers"]:
        who += f", {summary['drivers']} drivers"
    lines = [
        ("delay of all (s): mean", number(summary["delay_s"])),
        *_bound_lines(summary),
        (
            "mainline delay (s): mean, 95th percentile",
            _two(summary, "mainline_delay_s", "mainline_delay_p95_s"),
        ),
        (
            "ramp delay (s): mean, 95th percentile",
            _two(summary, "ramp_delay_s", "ramp_delay_p95_s"),
        ),
        (
            "mainline speed (m/s): mean, over 1 s bins ±",
            _two(summary, "mainline_speed_mps", "mainline_speed_std_mps"),
        ),
        (
            "ramp speed (m/s): mean, over 1 s bins ±",
            _two(summary, "ramp_speed_mps", "ramp_speed_std_mps"),
        ),
        (
            "vehicles: mainline, ramp, unserved",
            f"{summary['vehicles_mainline']}, {summary['vehicles_ramp']}, {summary['unserved']}",
        ),
        ("fuel (l)", number(summary["fuel_l"])),
        (
            "collisions, safe-distance violations",
            f"{summary['collisions']}, {summary['safety_violations']}",
        ),
        ("smallest margin over the safe distance (m)", _margin(summary)),
        ("smallest TTC (s), largest DRAC (m/s2)", _two(summary, "min_ttc_s", "max_drac_mps2")),
        (
            "largest severity J (m2/s4), hardest braking (m/s2)",
            _two(summary, "max_severity", "max_decel_mps2"),
        ),
    ]
    lines += [
        (
            "brakings beyond 3 and 4.5 m/s2, vehicles that stopped",
            f"{summary['hard_brakings_3']}, {summary['hard_brakings_4_5']}, {summary['stops']}",
        ),
    ]
    if summary["drivers"] is None:
        lines += [
            ("largest difference between plan and SUMO (m)", number(summary["plan_error_m"], 4)),
            ("unsafe commands that were replaced", str(summary["interventions"])),
        ]
        if any(summary[f"rung_{rung}"] for rung in RUNGS):
            by_rung = ", ".join(f"{rung} {summary[f'rung_{rung}']}" for rung in RUNGS)
            lines += [
                ("ramp vehicles by rung", by_rung),
                ("vehicles adjusted for others", str(summary["adjusted_vehicles"])),
            ]
    lines.append(("computed in (s)", number(summary["wall_s"])))
    title = (
        f"{summary['scenario']}: {who}, {summary['mainline_veh_h']:g} + {summary['ramp_veh_h']:g} "
        f"veh/h, seed {summary['seed']}"
    )
    return Table(title, ("what", "value"), tuple(lines))


def _bound_lines(summary: Row) -> list[tuple[str, str]]:
    if summary["lane_limit_veh_h"] is None:
        return []
    return [
        (
            "least delay that the lane allows (s), and the delay as a multiple of it",
            _two(summary, "delay_bound_s", "delay_bound_ratio"),
        ),
        ("most that the lane carries (veh/h)", number(summary["lane_limit_veh_h"], 0)),
    ]


def _margin(summary: Row) -> str:
    """The least margin, with its equation where that is not Eq. 1."""
    equation = summary["min_margin_equation"]
    over = f", over Eq. {equation}" if equation not in (None, 1) else ""
    return f"{number(summary['min_margin_m'], 3)}{over}"


def _two(summary: Row, first: str, second: str) -> str:
    return f"{number(summary[first])}, {number(summary[second])}"
