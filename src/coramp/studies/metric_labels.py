"""What the figures of a run are called in tables and pages: one name, unit and digits each."""

from typing import NamedTuple

from coramp.strategies.situation import RUNGS_OF_ONE_LANE
from coramp.studies.speed_unit import MPS, SpeedUnit

SPEED = "speed"
"""The unit of what is shown in the unit of speeds that was chosen."""
POWERS = {"m/s2": "m/s²", "m/s3": "m/s³", "m2/s4": "m²/s⁴", "g)2": "g)²"}
RUNG_COLUMNS = {rung: f"rung_{rung}" for rung in RUNGS_OF_ONE_LANE}
"""The columns that count the ramp vehicles of each rung."""


class MetricLabel(NamedTuple):
    """A figure's name, its unit ("" for none) and the digits that it is shown with."""

    name: str
    unit: str = ""
    digits: int = 2


LABELS: dict[str, MetricLabel] = {
    "delay_s": MetricLabel("delay of all", "s"),
    "delay_bound_s": MetricLabel("least delay that the lane allows", "s"),
    "delay_bound_ratio": MetricLabel("delay over the least that the lane allows"),
    "mainline_delay_s": MetricLabel("mainline delay", "s"),
    "mainline_delay_p95_s": MetricLabel("mainline delay, 95th percentile", "s"),
    "ramp_delay_s": MetricLabel("ramp delay", "s"),
    "ramp_delay_p95_s": MetricLabel("ramp delay, 95th percentile", "s"),
    "mainline_speed_mps": MetricLabel("mainline speed", SPEED),
    "ramp_speed_mps": MetricLabel("ramp speed", SPEED),
    "mainline_speed_std_mps": MetricLabel("fluctuation of mainline speed", SPEED),
    "ramp_speed_std_mps": MetricLabel("fluctuation of ramp speed", SPEED),
    "mainline_fcfs_delay_s": MetricLabel("mainline delay, first come first served", "s"),
    "ramp_fcfs_delay_s": MetricLabel("ramp delay, first come first served", "s"),
    "lane_limit_veh_h": MetricLabel("most that the lane carries", "veh/h", 0),
    "automated_delay_s": MetricLabel("delay of automated vehicles", "s"),
    "driver_delay_s": MetricLabel("delay of drivers", "s"),
    "fuel_l": MetricLabel("fuel", "l"),
    "fuel_ml": MetricLabel("fuel", "ml/vehicle"),
    "vehicles_mainline": MetricLabel("mainline vehicles", digits=0),
    "vehicles_ramp": MetricLabel("ramp vehicles", digits=0),
    "unserved": MetricLabel("unserved", digits=0),
    "collisions": MetricLabel("collisions", digits=0),
    "safety_violations": MetricLabel("safe-distance violations", digits=0),
    "min_margin_m": MetricLabel("smallest margin over the safe distance", "m", 3),
    "min_margin_equation": MetricLabel("the same, over which equation", digits=0),
    "min_merge_margin_m": MetricLabel("smallest margin over Eq. 15, 16 at lane changes", "m", 3),
    "min_ttc_s": MetricLabel("smallest TTC", "s"),
    "max_drac_mps2": MetricLabel("largest DRAC", "m/s2"),
    "max_severity": MetricLabel("largest severity J", "m2/s4"),
    "max_decel_mps2": MetricLabel("hardest braking", "m/s2"),
    "max_jerk_mps3": MetricLabel("jerk", "m/s3"),
    "hard_brakings_3": MetricLabel("brakings beyond 3 m/s2", digits=0),
    "hard_brakings_4_5": MetricLabel("brakings beyond 4.5 m/s2", digits=0),
    "stops": MetricLabel("vehicles that stopped on their way", digits=0),
    "plan_error_m": MetricLabel("largest difference between plan and SUMO", "m", 4),
    "automated_vehicles": MetricLabel("automated vehicles", digits=0),
    "automated_hard_brakings_3": MetricLabel(
        "brakings of automated vehicles beyond 3 m/s2", digits=0
    ),
    "driver_hard_brakings_3": MetricLabel("brakings of drivers beyond 3 m/s2", digits=0),
    "ramp_stops": MetricLabel("ramp vehicles that stopped", digits=0),
    "collisions_by_automated": MetricLabel("collisions that automated vehicles caused", digits=0),
    "collisions_by_driver": MetricLabel(
        "collisions of automated vehicles that drivers caused", digits=0
    ),
    "collisions_among_drivers": MetricLabel("collisions among drivers", digits=0),
    "broken_assumptions": MetricLabel("assumptions that drivers broke", digits=0),
    "automated_violations": MetricLabel("pairs nearer than automated vehicles promise", digits=0),
    "reports_sent": MetricLabel("reports sent", digits=0),
    "reports_lost": MetricLabel("reports lost", digits=0),
    "commands_sent": MetricLabel("commands sent", digits=0),
    "commands_lost": MetricLabel("commands lost", digits=0),
    "fallbacks": MetricLabel("fallbacks on board", digits=0),
    "vehicle_km": MetricLabel("distance driven", "km", 1),
    "conflicts_ttc_3": MetricLabel("pairs with TTC below 3 s", digits=0),
    "conflicts_ttc_1_5": MetricLabel("pairs with TTC below 1.5 s", digits=0),
    "conflicts_ttc_1": MetricLabel("pairs with TTC below 1 s", digits=0),
    "conflicts_drac_2": MetricLabel("pairs with DRAC above 2 m/s2", digits=0),
    "conflicts_drac_3_4": MetricLabel("pairs with DRAC above 3.4 m/s2", digits=0),
    "conflicts_drac_6": MetricLabel("pairs with DRAC above 6 m/s2", digits=0),
    "conflicts_pet_1": MetricLabel("lane changes with PET below 1 s", digits=0),
    "conflicts_pet_0_5": MetricLabel("lane changes with PET below 0.5 s", digits=0),
    "conflicts_pet_0_2": MetricLabel("lane changes with PET below 0.2 s", digits=0),
    "conflicts_j_1": MetricLabel("lane changes with J above (0.3 g)2", digits=0),
    "conflicts_j_10": MetricLabel("lane changes with J above 10 (0.3 g)2", digits=0),
    "conflicts_j_100": MetricLabel("lane changes with J above 100 (0.3 g)2", digits=0),
    "outer_lane_delay_s": MetricLabel("delay of who enters on the lane next to the ramp", "s"),
    "made_way": MetricLabel("automated vehicles that made way", digits=0),
    "interventions": MetricLabel("unsafe commands that were replaced", digits=0),
    "adjusted_vehicles": MetricLabel("vehicles adjusted for others", digits=0),
    "planning_ms": MetricLabel("planning", "ms", 3),
    "wall_s": MetricLabel("computed in", "s"),
    **{
        column: MetricLabel(f"ramp vehicles by rung {rung}", digits=0)
        for rung, column in RUNG_COLUMNS.items()
    },
}
"""By column of ``runs.parquet``, and of what studies derive from it."""


def label_of(column: str, unit: SpeedUnit = MPS) -> str:
    """Returns a figure's name with its unit, as headers have it; speeds in a unit."""
    label = LABELS[column]
    shown = unit.name if label.unit == SPEED else label.unit
    return f"{label.name} ({shown})" if shown else label.name


def in_unit(value: float | None, column: str, unit: SpeedUnit) -> float | None:
    """Returns a figure as it is shown: speeds in a unit, all others as they are."""
    return unit.of(value) if LABELS[column].unit == SPEED else value


def typeset(text: str) -> str:
    """Returns a text with powers in its units raised, as pages and figures have them."""
    for plain, raised in POWERS.items():
        text = text.replace(plain, raised)
    return text
