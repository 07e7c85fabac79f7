"""Who was on which lane of the mainline from when on, and who made way, from a run's records."""

import polars as pl

from coramp.records.run import RunRecords
from coramp.road.lanes import mainline_lane


def stays_of(run: RunRecords) -> pl.DataFrame:
    """Returns ``vehicle_id``, ``time_s`` and ``lane`` of each stay in a lane, in order."""
    names = run.motion["lane"].unique().to_list()
    number = {name: mainline_lane(name) for name in names}
    came = pl.col("lane") != pl.col("lane").shift(1).over("vehicle_id")
    return (
        run.motion.sort("vehicle_id", "time_s", maintain_order=True)
        .with_columns(lane=pl.col("lane").replace_strict(number, return_dtype=pl.Int64))
        .filter(came.fill_null(value=True))
        .select("vehicle_id", "time_s", "lane")
    )


def made_way_in(run: RunRecords) -> pl.DataFrame | None:
    """Returns ``vehicle_id``, ``time_s`` and ``station_m`` of automated vehicles that made way.

    These change lanes on the mainline for nothing else. None where nobody is automated.
    """
    automated = run.vehicles.filter("automated")["vehicle_id"].to_list()
    if not automated:
        return None
    before = pl.col("lane").shift(1).over("vehicle_id")
    further_in = (before >= 0) & (pl.col("lane") == before + 1)
    return (
        stays_of(run)
        .filter(pl.col("vehicle_id").is_in(automated) & further_in)
        .join(run.motion.select("vehicle_id", "time_s", "station_m"), on=["vehicle_id", "time_s"])
        .unique(["vehicle_id", "time_s"], maintain_order=True)
        .select("vehicle_id", "time_s", "station_m")
        .sort("time_s")
    )
