"""A record of what the coordinator knew of vehicles, where that was not what is true now."""

from dataclasses import dataclass, field

import numpy as np

from coramp._kernel import FloatArray
from coramp.mixed.users import RoadUsers
from coramp.worlds.faults.air import Air

OLD_S, WRONG_M = 1e-6, 1e-3
"""What is no older and no more wrong than this counts as what is true now."""
COLUMNS = (
    *("time_s", "vehicle", "station_m", "speed_mps", "on_mainline", "age_s", "error_m"),
    *("report_lost", "command_lost", "fallback"),
)


@dataclass
class HeardRecord:
    """One row a vehicle and decision at which something was old, wrong, lost or expired.

    All other rows would say that the coordinator knew what is true: they are left out, so that a
    perfect world takes no memory, and one in which little fails takes little.
    """

    _rows: list[FloatArray] = field(default_factory=list)

    def note(self, now_s: float, users: RoadUsers, seen: RoadUsers, air: Air) -> None:
        """Notes what was ``seen`` of the users that report, and what did not reach them."""
        own = np.flatnonzero(air.reporting[users.number])
        number = users.number[own]
        place = np.full(len(air.reporting), -1)
        place[seen.number] = np.arange(len(seen.number))
        there = place[number]
        known = there >= 0
        rows = np.full((len(number), len(COLUMNS)), np.nan)
        rows[:, 0], rows[:, 1] = now_s, number
        rows[known, 2], rows[known, 3] = seen.station_m[there[known]], seen.speed_mps[there[known]]
        rows[known, 4] = seen.on_mainline[there[known]]
        rows[:, 5] = air.age_s(now_s, number)
        rows[:, 6] = rows[:, 2] - users.station_m[own]
        for column, lost in zip((7, 8), air.lost_at(now_s), strict=True):
            among = np.zeros(len(air.reporting), np.bool_)
            among[lost] = True
            rows[:, column] = among[number]
        rows[:, 9] = air.falls_back(number)
        exact = known & (rows[:, 5] <= OLD_S) & (np.abs(rows[:, 6]) <= WRONG_M)
        kept = ~exact | (rows[:, 7:] > 0.5).any(axis=1)
        if kept.any():
            self._rows.append(rows[kept])

    def columns(self) -> dict[str, FloatArray]:
        """Returns the columns by name; ``vehicle`` is the number of the vehicle."""
        rows = np.concatenate([np.empty((0, len(COLUMNS))), *self._rows])
        return dict(zip(COLUMNS, rows.T, strict=True))
