"""What vehicles tell of themselves in SUMO, besides their reports once a second."""

from collections.abc import Mapping, Sequence

import numpy as np

from coramp._kernel import IntArray
from coramp.messages.events import Report
from coramp.messages.log import NO_POSITIONS, Positions
from coramp.worlds.sumo.cooperative import CooperativePlant
from coramp.worlds.sumo.network import LaneSpan
from coramp.worlds.sumo.session import Session
from coramp.worlds.telling import together


def positions_in_sumo(
    plant: CooperativePlant, vehicle_of_row: IntArray, step_s: float
) -> Positions:
    """Returns a report at each change of acceleration, and the comparisons with the plan.

    What drives on from a measured position, and is told a step later, is of that earlier time.
    """
    parts = [NO_POSITIONS]
    if plant.driven:
        rows = np.array(plant.driven)
        steps = np.rint(rows[:, 1] / step_s).astype(np.int64)
        of_s = rows[:, 1].copy()
        of_s[plant.carried_on] = (steps[plant.carried_on] - 1) * step_s
        parts.append(
            Positions(
                vehicle_of_row[rows[:, 0].astype(np.int64)],
                steps,
                of_s,
                rows[:, 2],
                rows[:, 3],
                rows[:, 4],
                np.zeros(len(rows), np.bool_),
            )
        )
    if plant.compared:
        rows = np.array(plant.compared)
        steps = rows[:, 1].astype(np.int64)
        parts.append(
            Positions(
                vehicle_of_row[rows[:, 0].astype(np.int64)],
                steps,
                np.asarray(steps * step_s, np.float64),
                rows[:, 2],
                rows[:, 3],
                np.full(len(rows), np.nan),
                np.ones(len(rows), np.bool_),
            )
        )
    return together(parts)


class DriversInSumo:
    """Has SUMO's drivers report where they are, when they are asked; ``told`` are their answers."""

    def __init__(self, session: Session, spans: Mapping[str, LaneSpan], step_s: float) -> None:
        self._session = session
        self._spans = spans
        self._step_s = step_s
        self.now_step = 0
        self.told: list[Report] = []

    def ask(self) -> list[Report]:
        """Returns where everyone was in SUMO's last step, the one before ``now_step``.

        Who entered in it does not report yet.
        """
        at_step = self.now_step - 1
        answers = []
        for name in self._session.since_before(at_step):
            lane, position_m = self._session.lane_and_position_m(name)
            station_m = self._spans[lane].start_m + position_m * self._spans[lane].per_m
            speed_mps = self._session.speed_mps(name)
            answers.append(Report(name, at_step * self._step_s, station_m, speed_mps))
        if not self.told or self.told[-1].time_s < at_step * self._step_s:
            self.told += answers
        return answers


def with_answers(
    positions: Positions, told: Sequence[Report], number: Mapping[str, int], step_s: float
) -> Positions:
    """Returns reports of once a second with what drivers answered, in its place at the same step.

    ``number`` are the numbers of the vehicles' requests.
    """
    if not told:
        return positions
    steps = np.rint(np.array([report.time_s for report in told]) / step_s).astype(np.int64)
    answers = Positions(
        np.array([number[report.vehicle_id] for report in told], np.int64),
        steps,
        np.asarray(steps * step_s, np.float64),
        np.array([report.station_m for report in told]),
        np.array([report.speed_mps for report in told]),
        np.full(len(told), np.nan),
        np.zeros(len(told), np.bool_),
    )
    others = Positions._make(column[~np.isin(positions.step, steps)] for column in positions)
    return together((others, answers))
