"""The kinds of messages, their columns and their order: what writer and reader of a log share.

Classes of ``messages.events`` and ``messages.commands``, and the kinds that they have in a log:

=================== ============================================================================
``RequestToEnter``  request
``Report``          report
``DetectorReading`` reading
``Acknowledgement`` acknowledgement; ``messages.log`` writes one after each entry and command
``Enter``           entry
``Follow``          command
``SetSignal``       signal
no class            comparison, which is an entry of ``messages.log.Positions``, as reports of a
                    whole run are; end, from ``messages.log.Told.end_step``
=================== ============================================================================
"""

from collections.abc import Collection
from typing import NamedTuple

import polars as pl

from coramp.vehicles.traits import Traits

LOG_VERSION = 3
"""Raised whenever messages get other columns, or mean something else."""
TRAIT_COLUMNS = tuple(Traits._fields)
"""Columns of what a vehicle can do: null where only the common limits bind it."""
PIECES = ("piece_time_s", "piece_station_m", "piece_speed_mps", "piece_accel_mps2")
COLUMNS: dict[str, pl.DataType | type[pl.DataType]] = {
    "version": pl.Int64,
    "time_s": pl.Float64,
    "kind": pl.String,
    "vehicle_id": pl.String,
    "of_s": pl.Float64,
    "stream": pl.String,
    "station_m": pl.Float64,
    "speed_mps": pl.Float64,
    "length_m": pl.Float64,
    "std_m": pl.Float64,
    "accel_mps2": pl.Float64,
    "merge_time_s": pl.Float64,
    **dict.fromkeys(PIECES, pl.List(pl.Float64)),
    "mainline_occupancy": pl.Float64,
    "queue_occupancy": pl.Float64,
    "passed_veh": pl.Int64,
    "green": pl.Boolean,
    "vehicle_type": pl.String,
    **{name: pl.Float64 for name in TRAIT_COLUMNS if name != "length_m"},
    "lane": pl.Int64,
    "lane_change_s": pl.Float64,
}
"""The columns of a log. A message has those of its kind, and null in all others."""
EVERY_KIND = ("version", "time_s", "kind")
"""Columns that every message has."""


class Kind(NamedTuple):
    """One kind of message.

    ``place`` is where it comes among the messages of one time. ``needs`` are the columns that it
    has beside version, time and kind, ``may_have`` those that may be null.
    """

    place: int
    needs: tuple[str, ...] = ()
    may_have: tuple[str, ...] = ()

    def fits(self, columns: Collection[str]) -> bool:
        """Whether a message of this kind may have just these columns."""
        return set(self.needs) <= set(columns) <= {*self.needs, *self.may_have}

    @property
    def lacks(self) -> tuple[str, ...]:
        """Columns that a message of this kind cannot have, in their order."""
        own = {*EVERY_KIND, *self.needs, *self.may_have}
        return tuple(name for name in COLUMNS if name not in own)


REPORT, COMPARISON, READING, REQUEST, ENTRY, COMMAND, ACKNOWLEDGEMENT, SIGNAL, END = (
    "report",
    "comparison",
    "reading",
    "request",
    "entry",
    "command",
    "acknowledgement",
    "signal",
    "end",
)
OBEYING = 4
"""The place of what vehicles tell as they obey: comparisons, and reports with an acceleration."""
_POSITION = ("of_s", "station_m", "speed_mps", "std_m", "vehicle_id")
_TRAJECTORY = (*PIECES, "vehicle_id")
KINDS = {
    REPORT: Kind(0, _POSITION, ("accel_mps2",)),
    COMPARISON: Kind(OBEYING, _POSITION, ("accel_mps2",)),
    READING: Kind(1, ("mainline_occupancy", "queue_occupancy", "passed_veh")),
    REQUEST: Kind(
        2,
        ("stream", "speed_mps", "length_m", "vehicle_type", "vehicle_id"),
        (*TRAIT_COLUMNS, "lane"),
    ),
    ENTRY: Kind(3, _TRAJECTORY, ("merge_time_s",)),
    COMMAND: Kind(3, _TRAJECTORY, ("merge_time_s", "lane_change_s")),
    ACKNOWLEDGEMENT: Kind(3, ("of_s", "vehicle_id")),
    SIGNAL: Kind(3, ("green",)),
    END: Kind(5),
}
"""All kinds by name.

A comparison is a position that SUMO was asked for where a vehicle changes lanes or leaves.
"""
CODES = {kind: code for code, kind in enumerate(KINDS)}
"""What stands for a kind in arrays."""


def place_of_each() -> pl.Expr:
    """Returns each message's place among those of its time."""
    obeying = (pl.col("kind") == COMPARISON) | pl.col("accel_mps2").is_not_null()
    places = {name: kind.place for name, kind in KINDS.items()}
    usual = pl.col("kind").replace_strict(places, return_dtype=pl.Int64)
    return pl.when(obeying).then(OBEYING).otherwise(usual)


def name_in_order() -> pl.Expr:
    """Returns the vehicle by which messages of one time and place come, null where by none.

    Positions come by vehicle, all others as they were told.
    """
    return pl.when(pl.col("kind").is_in([REPORT, COMPARISON])).then("vehicle_id")
