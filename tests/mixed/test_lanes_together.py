"""Several lanes: all that is decided at once, merges and making way, judged by plain arithmetic."""

import math

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coramp.mixed.lanes import Lanes, decided_in_lanes, on_endless_lanes
from coramp.mixed.on_board import Ahead
from tests.mixed.roads import GAPS, ON_BOARD, SAFETY, users_of

B_MPS2, MARGIN_M, PERIOD_S = SAFETY.braking_mps2, SAFETY.margin_m, ON_BOARD.period_s
EXACT_M = 1e-6
CREEPS_MPS = 2.0
"""Who is slower may stand nearer than the margin, as one that stands lets another in."""


@st.composite
def vehicles_of_lane(draw, lane, delay_s):
    """Vehicles of one lane, front first, each with the distance that it needs if automated."""
    rows, before = [], None
    at_m = draw(st.floats(-150.0, 190.0 if lane < 0 else 250.0))
    for _ in range(draw(st.integers(0, 4))):
        cav, mps = draw(st.booleans()), draw(st.floats(0.0, 30.0))
        length_m, brakes = draw(st.sampled_from([(5.0, 6.0), (5.0, 5.0), (12.0, 4.0)]))
        mps2 = max(draw(st.sampled_from([0.0, 0.0, -2.0, 1.0])), -mps / 2.0)
        if lane < 0:
            mps = min(mps, math.sqrt(2.0 * SAFETY.stop_mps2 * max(0.0, 190.0 - at_m)))
        way_m, then_mps = mps * delay_s + mps2 * delay_s**2 / 2.0, mps + mps2 * delay_s
        if before is not None:
            (ahead_m, ahead_mps, ahead_length_m), more_m = before, draw(st.floats(0.0, 60.0))
            needs_m = max(0.0, then_mps**2 / (2.0 * brakes) - ahead_mps**2 / (2.0 * B_MPS2))
            needs_m = way_m + MARGIN_M + needs_m + EXACT_M if cav else 0.5
            at_m = ahead_m - ahead_length_m - needs_m - more_m
        rows.append((lane, at_m, mps, cav, length_m, brakes, mps2))
        before = at_m, mps, length_m
    return rows


@st.composite
def situations(draw):
    """Rows of vehicles on two to four lanes and a ramp, what each is told, and the delay (s)."""
    delay_s = draw(st.sampled_from([0.0, 0.0, 0.3]))
    lanes = draw(st.integers(2, 4))
    rows = [row for lane in range(-1, lanes) for row in draw(vehicles_of_lane(lane, delay_s))]
    told = [draw(st.sampled_from([math.inf, -0.1, -0.2, -1.0, -3.0])) for _ in rows]
    wishes = [row[0] < 0 and row[3] and draw(st.booleans()) for row in rows]
    return rows, told, wishes, lanes, delay_s


def decided(situation):
    """What the law answers: accelerations (m/s2) and who changes lanes, a list each."""
    rows, told, wishes, lanes, delay_s = situation
    users = users_of([(x, v, lane >= 0, cav, *rest) for lane, x, v, cav, *rest in rows])
    ahead = Ahead(
        users.speed_mps * delay_s + users.accel_mps2 * delay_s**2 / 2.0,
        users.speed_mps + users.accel_mps2 * delay_s,
        delay_s,
    )
    number = np.array([row[0] for row in rows], np.int64)
    nobody = np.zeros(len(rows), np.bool_)
    of_lanes, wish = Lanes(number, number < lanes - 1, nobody), np.array(wishes, np.bool_)
    laws = ON_BOARD, on_endless_lanes(ON_BOARD)
    obeys, accels, changes, asks = decided_in_lanes(
        users, of_lanes, ahead, np.array(told, np.float64), wish, *laws
    )
    assert np.isfinite(accels).all()
    assert len(obeys) == len(accels) == len(changes) == len(asks) == len(rows)
    return accels.tolist(), changes.tolist()


def pairs_in_lanes(rows, changes):
    """Who follows whom while lanes are changed: everybody is on its old lane and on its new one."""
    found = set()
    for lane in range(-1, 4):
        there = [k for k, row in enumerate(rows) if lane in (row[0], row[0] + changes[k])]
        there.sort(key=lambda k: -rows[k][1])
        found |= set(zip(there[1:], there[:-1], strict=True))
    return found


def spare_m(rear, front, accel_mps2, delay_s):
    """What is left of the distance that ``rear`` needs once a period is over.

    ``front`` brakes at b from now on, and ``rear`` begins with its acceleration after the delay.
    """
    _, front_m, front_mps, _, front_length_m, *_ = front
    _, rear_m, rear_mps, _, _, brakes, mps2 = rear
    braked_s = min(delay_s + PERIOD_S, front_mps / B_MPS2)
    front_m += front_mps * braked_s - B_MPS2 * braked_s**2 / 2.0
    front_mps -= B_MPS2 * braked_s
    then_mps = rear_mps + mps2 * delay_s
    rear_m += rear_mps * delay_s + mps2 * delay_s**2 / 2.0
    rear_m += then_mps * PERIOD_S + accel_mps2 * PERIOD_S**2 / 2.0
    then_mps += accel_mps2 * PERIOD_S
    gap_m = front_m - front_length_m - rear_m
    return gap_m + front_mps**2 / (2.0 * B_MPS2) - then_mps**2 / (2.0 * brakes)


GAP = [(1, 60.0, 20.0, True, 5.0, 6.0, 0.0), (1, -60.0, 20.0, True, 5.0, 6.0, 0.0)]
WAY = (0, 0.0, 20.0, True, 5.0, 6.0, 0.0)
HELD = (-1.0, *[math.inf] * 3)
TRUCK_TAIL_M = 0.5 * 15.0**2 * (1.0 / 4.0 - 1.0 / 6.0) + MARGIN_M + 15.0 * SAFETY.reaction_s + 0.01
"""What a truck at 15 m/s that brakes with 4 m/s2 needs behind a car as fast, after it reacts."""


@settings(max_examples=300, deadline=None)
@given(situations())
@example(([WAY, *GAP], HELD[:3], [False] * 3, 2, 0.0))
@example(  # a truck makes way behind a car, as near as it may: it does not speed up
    (
        [
            (0, 0.0, 15.0, True, 12.0, 4.0, 0.0),
            (1, 5.0 + TRUCK_TAIL_M, 15.0, True, 5.0, 6.0, 0.0),
        ],
        HELD[:2],
        [False] * 2,
        2,
        0.0,
    )
)
@example(  # a car makes way before a truck, as near as it may: the truck does not speed up
    (
        [
            (0, 0.0, 15.0, True, 5.0, 6.0, 0.0),
            (1, -5.0 - TRUCK_TAIL_M, 15.0, True, 12.0, 4.0, 0.0),
        ],
        HELD[:2],
        [False] * 2,
        2,
        0.0,
    )
)
def test_every_automated_vehicle_keeps_the_distance_that_it_needs_on_each_of_its_lanes(situation):
    rows, delay_s = situation[0], situation[-1]
    accels, changes = decided(situation)
    for rear, front in pairs_in_lanes(rows, changes):
        if rows[rear][3]:
            creeps = rows[rear][2] + rows[rear][6] * delay_s < CREEPS_MPS
            least_m = 0.0 if creeps else MARGIN_M
            assert spare_m(rows[rear], rows[front], accels[rear], delay_s) >= least_m - EXACT_M


@settings(max_examples=300, deadline=None)
@given(situations())
@example(
    # told to slow down by 0.2 m/s2, and near to a slow leader that makes it brake far harder
    (
        [
            (0, 90.0, 6.0, False, 5.0, 6.0, 0.0),
            (0, 47.0, 20.0, True, 5.0, 6.0, 0.0),
            (1, 18.6, 20.0, False, 5.0, 6.0, 0.0),
        ],
        [math.inf, -0.2, math.inf],
        [False] * 3,
        2,
        0.0,
    )
)
def test_a_driver_behind_need_not_brake_harder_than_in_comfort(situation):
    rows, delay_s = situation[0], situation[-1]
    accels, changes = decided(situation)
    for own in np.flatnonzero(changes):
        lane, own_m, own_mps, cav, length_m, _, mps2 = rows[own]
        assert cav
        behind = [row for row in rows if row[0] == lane + 1 and row[1] <= own_m]
        rear = max(behind, key=lambda row: row[1], default=None)
        if rear is None or rear[3]:
            continue
        then_mps = own_mps + mps2 * delay_s + accels[own] * PERIOD_S
        room_m = own_m - length_m - rear[1] + SAFETY.relax_m
        room_m -= GAPS.of_driver_m + GAPS.of_driver_s * rear[2]
        needs_m = (rear[2] ** 2 - then_mps**2) / (2.0 * SAFETY.driver_mps2)
        assert room_m >= needs_m - EXACT_M


@settings(max_examples=200, deadline=None)
@given(situations())
@example(  # one merges before another that could make way
    (
        [(0, 0.0, 20.0, True, 5.0, 6.0, 0.0), (-1, 60.0, 15.0, True, 5.0, 6.0, 0.0)],
        HELD[:2],
        [False, True],
        2,
        0.0,
    )
)
@example(([WAY, *GAP], HELD[:3], [False] * 3, 1, 0.0))
@example(([(0, 198.0, 20.0, True, 5.0, 6.0, 0.0)], HELD[:1], [False], 2, 0.0))
def test_who_makes_way_has_a_gap_to_itself_and_is_told_to_slow_down(situation):
    rows, told, wishes, lanes, _ = situation
    _, changes = decided(situation)
    gaps = []
    for own in np.flatnonzero(changes):
        lane, own_m, _, cav, *_ = rows[own]
        if lane < 0:
            assert wishes[own]
            continue
        assert lane == 0 < lanes - 1
        assert cav
        assert told[own] <= -0.2
        assert own_m < SAFETY.lane_end_m
        gaps.append(sum(row[0] == 1 and row[1] >= own_m for row in rows))
        # nobody comes in behind its old leader, before it, at the same time
        merging = [row[1] for k, row in enumerate(rows) if changes[k] and row[0] < 0]
        follower_of = [
            max((row[1] for row in rows if row[0] == 0 and row[1] < at_m), default=None)
            for at_m in merging
        ]
        assert own_m not in follower_of
    assert len(set(gaps)) == len(gaps)


def test_what_it_was_told_is_for_the_lane_that_it_leaves():
    def accel_mps2(*others):
        rows = [WAY, *others]
        return decided((rows, [-1.0] + [math.inf] * len(others), [False] * 3, 2, 0.0))[0][0]

    assert accel_mps2(*GAP) == 0.0  # it cruises
    beside = (1, 2.0, 20.0, True, 5.0, 6.0, 0.0)
    assert accel_mps2(beside, GAP[1]) == -1.0


@settings(max_examples=150, deadline=None)
@given(situations(), st.randoms(use_true_random=False))
def test_the_order_in_which_vehicles_are_listed_changes_nothing(situation, chance):
    rows, told, wishes, lanes, delay_s = situation
    accels, changes = decided(situation)
    assert decided(situation) == (accels, changes)
    order = list(range(len(rows)))
    chance.shuffle(order)
    picked = [[of[k] for k in order] for of in (rows, told, wishes)]
    if len({row[1] for row in rows}) == len(rows):
        found = decided((*picked, lanes, delay_s))
        assert found == ([accels[k] for k in order], [changes[k] for k in order])


@settings(max_examples=150, deadline=None)
@given(situations())
def test_lanes_that_are_further_in_than_the_next_one_change_nothing(situation):
    rows, told, wishes, lanes, delay_s = situation
    near = [k for k, row in enumerate(rows) if row[0] <= 1]
    picked = [[of[k] for k in near] for of in (rows, told, wishes)]
    accels, changes = decided(situation)
    found = decided((*picked, lanes, delay_s))
    assert found == ([accels[k] for k in near], [changes[k] for k in near])


any_row = st.tuples(
    st.integers(-1, 3),
    st.floats(-300.0, 300.0),
    st.floats(0.0, 40.0),
    st.booleans(),
    st.sampled_from([5.0, 18.0]),
    st.sampled_from([4.0, 6.0]),
    st.floats(-6.0, 3.0),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(any_row, max_size=12), st.floats(-8.0, 3.0), st.booleans())
def test_whatever_is_wrong_there_is_an_answer_that_brakes_can_give(rows, told_mps2, wish):
    wishes = [wish and row[3] and row[0] < 0 for row in rows]
    accels, changes = decided((rows, [told_mps2] * len(rows), wishes, 4, 0.0))
    for row, accel, moves in zip(rows, accels, changes, strict=True):
        lowest = -max(SAFETY.hardest_mps2, row[2] / PERIOD_S)
        assert lowest <= accel <= 2.5
        assert row[3] or (accel == 0.0 and not moves)
