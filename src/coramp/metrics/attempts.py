"""The table of what was tried for each decision, and what the checker said of it."""

from collections.abc import Iterator, Sequence

import polars as pl

from coramp._kernel import IntArray
from coramp.coordination.decision_log import DecisionRecord, Refusal
from coramp.records.schemas import ATTEMPTS, Row
from coramp.strategies.attempts import CHOSEN, Attempt, Tried

REFUSED_BY_CHECKER = "the checker refuses the plan"
_VEHICLES = {
    "front_vehicle_id": "front_row",
    "rear_vehicle_id": "rear_row",
    "other_vehicle_id": "other_row",
    "moved_vehicle_id": "moved_row",
}
_AS_THEY_ARE = tuple(name for name in ATTEMPTS if name in Attempt._fields)


def attempts_table(
    decisions: Sequence[DecisionRecord],
    refusals: Sequence[Refusal],
    vehicle_ids: Sequence[str],
    vehicle_of_row: IntArray,
) -> pl.DataFrame:
    """Returns one row an attempt, by time; what an attempt has not is null.

    The plans that the checker refused are there too, once for each reason in a row. Numbers of
    attempts count from 1 in each decision.
    """

    def name(row: int) -> str | None:
        return vehicle_ids[vehicle_of_row[row]] if row >= 0 else None

    found: list[Row] = []
    for time_s, subject, number, attempt, refusal in _in_order(decisions, refusals):
        row: Row = {key: getattr(attempt, key, None) for key in _AS_THEY_ARE}
        row.update({key: name(getattr(attempt, field)) for key, field in _VEHICLES.items()})
        row["time_s"], row["vehicle_id"], row["attempt"] = time_s, name(subject), number
        row["scenario"] = attempt.scenario or None
        if refusal is not None:
            row["reason"], row["checker_reason"] = REFUSED_BY_CHECKER, refusal.reason
            row["other_vehicle_id"], row["missing_m"] = name(refusal.other_row), refusal.missing_m
        found.append(row)
    frame = pl.DataFrame(found, schema=ATTEMPTS, orient="row")
    return frame.with_columns(
        pl.when(pl.col(pl.Float64).is_finite()).then(pl.col(pl.Float64)).name.keep()
    )


def _in_order(
    decisions: Sequence[DecisionRecord], refusals: Sequence[Refusal]
) -> Iterator[tuple[float, int, int, Attempt, Refusal | None]]:
    """Yields time, row of the subject, number, attempt and the checker's refusal of it, if any."""
    told: list[tuple[float, int, Sequence[Attempt], Refusal | None]] = [
        (d.time_s, d.explanation.row, d.explanation.tried, None) for d in decisions
    ]
    told += [
        (r.time_s, r.row, r.tried or (Attempt("hold"),), r) for r in refusals if r.tried is not None
    ]
    for time_s, subject, tried, refusal in sorted(told, key=lambda one: one[0]):
        left_out = tried.left_out if isinstance(tried, Tried) else 0
        for place, attempt in enumerate(tried):
            last = place == len(tried) - 1
            yield (
                time_s,
                subject,
                place + 1 + (left_out if last else 0),
                attempt,
                refusal if attempt.reason == CHOSEN else None,
            )
