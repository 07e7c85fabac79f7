"""What the columns of a study's overview mean, a line each."""

from collections.abc import Sequence

from coramp.studies.metric_labels import LABELS
from coramp.studies.tables import Table

MEANINGS = {
    "delay_s": "time that a vehicle loses against driving freely, from its scheduled entry; a mean "
    "over all vehicles of a run",
    "delay_bound_s": "the same, if equal vehicles passed in the order of first come, first served, "
    "granting each run where it was quicker or closer; so it differs by strategy",
    "mainline_delay_s": "the delay of mainline vehicles",
    "ramp_delay_s": "the delay of ramp vehicles; negative where they drove the ramp faster, or "
    "accelerated harder, than in free flow",
    "mainline_speed_mps": "the mean over mainline vehicles of each one's mean speed from entry "
    "to exit",
    "ramp_speed_mps": "the same of ramp vehicles, on ramp, acceleration lane and mainline",
    "fuel_l": "fuel of all vehicles of a run together, from entry to exit; a mean over seeds",
    "unserved": "vehicles that had not got out at the end, all seeds together",
    "min_ttc_s": "time to collision, the time in which a vehicle would reach its leader if both "
    "kept their speeds; the smallest of all vehicles, times and seeds",
    "max_decel_mps2": "the hardest braking of any vehicle, at any time, with any seed",
}
"""By column of ``runs.parquet``."""
OTHERS = {
    "flow": "vehicles that were asked for per hour, mainline + ramp",
    "runs": "how many runs, a seed each, the row is of",
    "engine": "what moved the vehicles: SUMO, or the plans themselves (exact)",
    "scenario": "the road that was run",
}
"""By the header of a column that is no figure."""


def meanings_of(tables: Sequence[Table]) -> list[tuple[str, str]]:
    """Returns name and meaning of each column that the overview shows; none without an overview."""
    shown = next((table.columns for table in tables if table.title == "All runs"), ())
    named = {LABELS[column].name: meaning for column, meaning in MEANINGS.items()} | OTHERS
    heads = [name.partition(" (")[0] for name in shown]
    return [(head, named[head]) for head in heads if head in named]
