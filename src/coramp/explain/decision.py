"""Every quantity of a decision, with the number of its equation in the paper.

The numbers that the equations rest on are read from the record of the decision and of its attempts;
of the scenario only the constants of the equations are needed: v0, the safe distances, the
acceleration lane and the largest acceleration.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from coramp.explain.case import case_of, chosen_of, merge_of
from coramp.explain.found import conflict, distances, free_movement
from coramp.explain.merge import acceleration, creation, least_effort
from coramp.explain.quantity import Quantity
from coramp.records.schemas import Row
from coramp.road.rules import Rules


def quantities(
    decision: Mapping[str, Any], attempts: Sequence[Row], rules: Rules
) -> list[Quantity]:
    """Returns the quantities behind one row of ``decisions.parquet``, in the paper's order.

    ``attempts`` are the rows of ``attempts.parquet`` of that decision; without any, nothing is
    known of what the equations rest on, and nothing is returned.
    """
    if not attempts:
        return []
    case = case_of(decision, attempts, rules)
    lines = distances(case)
    if not math.isnan(case.free_mps2):
        lines += [*free_movement(case), *conflict(case)]
    chosen = chosen_of(attempts)
    if chosen is not None:
        merge = merge_of(decision, chosen, rules)
        if not merge.accelerates_evenly:
            return _known([*lines, *least_effort(merge)])
        if decision["rung"] == "delay":
            lines.append(Quantity("24", "t_1", "time to the nose, delayed", merge.t1_s, "s"))
        lines += acceleration(merge)
        if merge.scenario:
            lines += creation(merge)
    return _known(lines)


def _known(lines: list[Quantity]) -> list[Quantity]:
    return [line for line in lines if isinstance(line.value, bool) or not math.isnan(line.value)]
