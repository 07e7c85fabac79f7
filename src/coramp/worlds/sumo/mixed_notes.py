"""What is noted of a run of mixed traffic as it goes: what was known, told and done, and why.

Nothing that is noted changes what happens.
"""

from dataclasses import dataclass, field

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.mixed.binding import binding_laws
from coramp.mixed.lanes import Lanes, neighbours_in_lanes
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import Ahead, neighbours_of
from coramp.mixed.situation import Places
from coramp.mixed.users import NOBODY, RoadUsers, in_order
from coramp.worlds.faults.air import Air
from coramp.worlds.faults.heard import HeardRecord
from coramp.worlds.sumo.files import SumoOptions

COLUMNS = (
    *("time_s", "vehicle", "station_m", "speed_mps", "measured_mps2", "lane", "law"),
    "accel_mps2",
    *("told_mps2", "given_s", "fallback", "place", "after", "changes", "ahead_m", "ahead_mps"),
    *("leader", "leader_gap_m", "leader_speed_mps", "leader_accel_mps2"),
    *("front", "front_gap_m", "front_speed_mps", "front_accel_mps2"),
    *("rear", "rear_gap_m", "rear_speed_mps", "rear_accel_mps2"),
)


@dataclass
class OnBoardRecord:
    """One row a decision and automated vehicle, and driver on the ramp: what it does and why.

    Lanes are those of ``Lanes``: -1 for the ramp, 0 for the mainline's lane next to it.
    """

    _rows: list[FloatArray] = field(default_factory=list)

    def note(
        self,
        now_s: float,
        placed: tuple[RoadUsers, Lanes | None],
        ahead: Ahead,
        given: tuple[RoadUsers, FloatArray, Air, Places],
        driven: tuple[FloatArray, BoolArray],
        laws: OnBoardLaws,
    ) -> None:
        """Notes what was ``given``, with whom the coordinator knew and where it placed them.

        ``placed`` are all users and, where there are several lanes, on which they are.
        """
        (users, lanes), (seen, told_mps2, air, places) = placed, given
        accel_mps2, changes = driven
        around = neighbours_of(users) if lanes is None else neighbours_in_lanes(users, lanes)
        makes_way = changes & users.on_mainline
        obeys_mps2 = np.where(makes_way, np.inf, told_mps2)
        law = binding_laws(users, around, ahead, obeys_mps2, changes, laws, accel_mps2)
        place, after = order_of(seen, places, len(air.reporting))
        number = users.number
        beside = makes_way | (~users.on_mainline & (users.station_m > 0.0))
        rows = np.column_stack(
            [
                np.full(len(number), now_s),
                number,
                users.station_m,
                users.speed_mps,
                users.accel_mps2,
                users.on_mainline - 1.0 if lanes is None else lanes.number,
                law,
                np.where(users.automated, accel_mps2, np.nan),
                np.where(np.isfinite(told_mps2), told_mps2, np.nan),
                air.given_s(number),
                air.falls_back(number),
                place[number],
                after[number],
                changes,
                np.where(users.automated, ahead.way_m, np.nan),
                np.where(users.automated, ahead.speed_mps, np.nan),
                *_neighbour(users, around.leader, around.leader >= 0),
                *_neighbour(users, around.front, beside & (around.front >= 0)),
                *_follower(users, around.rear, beside & (around.rear >= 0)),
            ]
        )
        self._rows.append(rows[users.automated | ~users.on_mainline])

    def columns(self) -> dict[str, FloatArray]:
        """Returns the columns by name; vehicles are named by their numbers, -1 for nobody."""
        rows = np.concatenate([np.empty((0, len(COLUMNS))), *self._rows])
        return dict(zip(COLUMNS, rows.T, strict=True))


def order_of(seen: RoadUsers, places: Places, vehicles: int) -> tuple[IntArray, IntArray]:
    """Returns each vehicle's place in the order of passing, from 1, and whom it is to pass after.

    One entry for each of all ``vehicles``; 0 and -1 for who is not known.
    """
    mainline = in_order(seen.station_m, seen.on_mainline)
    order = seen.number[mainline].tolist()
    for own, front in places:
        order.insert(order.index(front) + 1 if front in order else 0, own)
    place, after = np.zeros(vehicles, np.int64), np.full(vehicles, NOBODY)
    place[order] = np.arange(1, len(order) + 1)
    after[order[1:]] = order[:-1]
    return place, after


def _neighbour(users: RoadUsers, other: IntArray, there: BoolArray) -> tuple[FloatArray, ...]:
    """Number, distance, speed and acceleration (SI) of who is in front of each, nan for none."""
    gap_m = users.station_m[other] - users.length_m[other] - users.station_m
    return _where(there, users, other, gap_m)


def _follower(users: RoadUsers, other: IntArray, there: BoolArray) -> tuple[FloatArray, ...]:
    """The same of the vehicle behind each."""
    gap_m = users.station_m - users.length_m - users.station_m[other]
    return _where(there, users, other, gap_m)


def _where(
    there: BoolArray, users: RoadUsers, other: IntArray, gap_m: FloatArray
) -> tuple[FloatArray, ...]:
    return (
        np.where(there, users.number[other], NOBODY).astype(np.float64),
        np.where(there, gap_m, np.nan),
        np.where(there, users.speed_mps[other], np.nan),
        np.where(there, users.accel_mps2[other], np.nan),
    )


@dataclass
class Notes:
    """What is noted of a run; None for what is not to be."""

    heard: HeardRecord | None
    on_board: OnBoardRecord | None
    _told: tuple[RoadUsers, FloatArray] | None = None

    def told(
        self, now_s: float, users: RoadUsers, seen: RoadUsers, told_mps2: FloatArray, air: Air
    ) -> None:
        """Notes what was known of users when vehicles were told how much they may speed up."""
        self._told = seen, told_mps2
        if self.heard is not None:
            self.heard.note(now_s, users, seen, air)

    def driven(
        self,
        now_s: float,
        placed: tuple[RoadUsers, Lanes | None],
        ahead: Ahead,
        driven: tuple[FloatArray, BoolArray],
        control: tuple[Air, Places, OnBoardLaws],
    ) -> None:
        """Notes what vehicles do: accelerations (m/s2), and who changes lanes.

        ``placed`` are the vehicles and, on a road of several lanes, their lanes.
        """
        if self.on_board is None or self._told is None:
            return
        air, places, laws = control
        self.on_board.note(now_s, placed, ahead, (*self._told, air, places), driven, laws)


def notes_of(options: SumoOptions, air: Air) -> Notes | None:
    """Returns what is to be noted, None for nothing: in a perfect world all is known at once."""
    asked = options.keep_heard or options.keep_messages
    heard = HeardRecord() if asked and not air.is_perfect else None
    on_board = OnBoardRecord() if options.keep_messages else None
    return Notes(heard, on_board) if heard is not None or on_board is not None else None
