"""The gate: vehicles that ask to enter do so as soon as it is safe, each stream in its order.

One kernel lets in everyone up to the next decision, so that a run asks Python only for decisions.
"""

from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.checker.checker import Entry, examine_entry
from coramp.checker.distances import Bounds
from coramp.checker.reasons import ACCEPTED, TOO_NEAR, TOO_NEAR_AT_MERGE
from coramp.checker.record import Record
from coramp.coordination.admission import decision_due_s, plan_entry
from coramp.coordination.book import (
    BLOCKS,
    INNER,
    LIVE,
    ROWS,
    Book,
    strike_exited,
    ways_of,
)
from coramp.coordination.commitments import NO_ROOM, commit_entry
from coramp.messages.feed import RequestFeed
from coramp.motion.clock import first_step_from
from coramp.road.rules import Rules, unpacked
from coramp.strategies.base import Entered, Waiting
from coramp.vehicles.fleet import in_lane
from coramp.vehicles.traits import LENGTH, traits_or_usual

NEVER = 1 << 60
WAITS, CROWDED = -1, -2
OUTERMOST, RAMP, SECOND = range(3)
"""Streams of the gate: the mainline's outermost lane, the ramp, and the lanes further in."""
HEARD, OFFERED, OPEN = range(3)
"""Places in ``Gate.feed``."""
DONE, FULL, REFUSED = range(3)
"""Why ``admit_until`` came back: nobody else is due, the book is full, the checker refused."""
ARRIVAL, CODE, COMMITMENTS, ON_ROAD = range(4)
"""Columns of ``Gate.refused``."""


class Gate(NamedTuple):
    """Requests to enter, who is next on each stream, and who entered when.

    The first five fields are those of the world's feed. A request is read, and counted in
    ``feed[HEARD]``, only when its step has come.

    - ``of_stream[s]``: the ``vehicles[s]`` requests of stream s that have been heard.
    - ``next_place[s]``: the place among them of the first that has not entered.
    - ``try_step[s]``: the step at which that one tries to enter.
    - ``row_arrival``, ``row_step``, ``row_due_step``: for each row of the book its request, the
      step at which it entered, and the step at which it is to be planned.
    - ``asks[0]``: whether the strategy is asked about each vehicle as it enters.
    - ``slowest_mps[0]``: a mainline vehicle waits outside rather than enter and brake below this.
    - ``feed``: requests heard, requests that the feed has, and whether the gate is open.
    - ``refused[s]``: which vehicle of a stream the checker refused last and why, and how many
      commitments and vehicles on the road there were then.
    """

    step: IntArray
    on_ramp: BoolArray
    speed_mps: FloatArray
    traits: FloatArray
    lane: IntArray
    of_stream: IntArray
    vehicles: IntArray
    next_place: IntArray
    try_step: IntArray
    row_arrival: IntArray
    row_step: IntArray
    row_due_step: IntArray
    asks: BoolArray
    slowest_mps: FloatArray
    feed: IntArray
    refused: IntArray


class Stop(NamedTuple):
    """Why, when and over which arrival ``admit_until`` came back, with the checker's code."""

    why: int
    step: int
    arrival: int
    code: int


def gate_for(
    feed: RequestFeed, asks: bool = False, slowest_mps: float = 0.0, lanes: int = 1
) -> Gate:
    """Returns the gate before anyone has entered; nobody tries until ``open_gate``."""
    room, streams = len(feed.arrays.step), lanes + 1
    return Gate(
        *feed.arrays,
        np.zeros((streams, room), np.int64),
        np.zeros(streams, np.int64),
        np.zeros(streams, np.int64),
        np.full(streams, NEVER),
        np.zeros(room, np.int64),
        np.zeros(room, np.int64),
        np.full(room, NEVER),
        np.array([asks]),
        np.array([slowest_mps]),
        np.array([0, len(feed), 0], np.int64),
        np.full((streams, 4), -1),
    )


def with_feed(gate: Gate, feed: RequestFeed) -> Gate:
    """Returns the gate with all that the feed has by now."""
    gate.feed[OFFERED] = len(feed)
    old, room = gate.of_stream.shape[1], len(feed.arrays.step)
    if room == old:
        return gate
    of_stream = np.zeros((len(gate.vehicles), room), np.int64)
    of_stream[:, :old] = gate.of_stream
    more = room - old
    return gate._replace(
        **feed.arrays._asdict(),
        of_stream=of_stream,
        row_arrival=np.append(gate.row_arrival, np.zeros(more, np.int64)),
        row_step=np.append(gate.row_step, np.zeros(more, np.int64)),
        row_due_step=np.append(gate.row_due_step, np.full(more, NEVER)),
    )


def entries_of(gate: Gate, rows: range, step_s: float) -> tuple[Entered, ...]:
    """Returns the entries of these rows of the book, but for those on lanes further in."""
    entries = []
    for row in rows:
        k = gate.row_arrival[row]
        if gate.lane[k] > 0:
            continue
        entered_s, since_s = float(gate.row_step[row] * step_s), float(gate.step[k] * step_s)
        entries.append(Entered(row, bool(gate.on_ramp[k]), entered_s, since_s))
    return tuple(entries)


def waiting_at(gate: Gate, step: int, step_s: float) -> Waiting:
    """Returns who has come by ``step`` and not entered, but for those on lanes further in."""
    return Waiting(*_waiting_at(gate, step, step_s))


@kernel
def _waiting_at(
    gate: Gate, step: int, step_s: float
) -> tuple[IntArray, BoolArray, FloatArray, FloatArray]:
    """Returns the fields of ``Waiting``."""
    counts = np.zeros(2, np.int64)
    for stream in range(2):
        place = gate.next_place[stream]
        while (
            place + counts[stream] < gate.vehicles[stream]
            and gate.step[gate.of_stream[stream, place + counts[stream]]] <= step
        ):
            counts[stream] += 1
    numbers: IntArray = np.empty(counts.sum(), np.int64)
    for stream in range(2):
        place, start = gate.next_place[stream], counts[0] * stream
        numbers[start : start + counts[stream]] = gate.of_stream[
            stream, place : place + counts[stream]
        ]
    since_s = np.empty(len(numbers))
    since_s[:] = gate.step[numbers] * step_s
    return numbers, gate.on_ramp[numbers], since_s, gate.traits[numbers, LENGTH]


@kernel
def open_gate(gate: Gate) -> None:
    """Has requests heard from now on, each when its step has come."""
    gate.feed[OPEN] = 1


@kernel
def next_step(gate: Gate) -> int:
    """Returns when somebody tries to enter, or the next request is due."""
    step = np.min(gate.try_step)
    heard = gate.feed[HEARD]
    if gate.feed[OPEN] == 1 and heard < gate.feed[OFFERED]:
        step = min(step, gate.step[heard])
    return int(step)


@kernel
def _hear(gate: Gate, step: int) -> None:
    """Reads the requests that are due by ``step``."""
    while gate.feed[HEARD] < gate.feed[OFFERED] and gate.step[gate.feed[HEARD]] <= step:
        request = gate.feed[HEARD]
        stream = RAMP if gate.on_ramp[request] else OUTERMOST
        if gate.lane[request] > 0:
            stream = SECOND + gate.lane[request] - 1
        place = gate.vehicles[stream]
        gate.of_stream[stream, place] = request
        gate.vehicles[stream] += 1
        gate.feed[HEARD] += 1
        if gate.next_place[stream] == place:
            _next_tries(gate, stream, 0)


@kernel
def _next_tries(gate: Gate, stream: int, step: int) -> None:
    place = gate.next_place[stream]
    if place < gate.vehicles[stream]:
        gate.try_step[stream] = max(step, gate.step[gate.of_stream[stream, place]])
    else:
        gate.try_step[stream] = NEVER


@kernel
def admit_until(
    book: Book,
    record: Record,
    gate: Gate,
    last_step: int,
    packed_rules: FloatArray,
    bounds: Bounds,
) -> Stop:
    """Lets in whoever is due, up to ``last_step`` or the step at which one of them is planned.

    Whoever cannot enter safely tries again at the next step, and holds up those behind. Whom the
    checker refuses for its own plan's sake tries again once others have planned, come or gone; a
    refusal is told once. Whoever has left the zone by then is off the live list.
    """
    rules = unpacked(packed_rules)
    while True:
        step = next_step(gate)
        strike_exited(book, min(step, last_step) * rules.control.step_s)
        if step > last_step:
            return Stop(DONE, step, -1, ACCEPTED)
        _hear(gate, step)
        for stream in range(len(gate.vehicles)):
            while gate.try_step[stream] <= step:
                arrival = gate.of_stream[stream, gate.next_place[stream]]
                if _is_as_refused(book, gate, stream, arrival):
                    gate.try_step[stream] = step + 1
                    continue
                start_m = start_of_m(stream, rules)
                code = enter(book, record, gate, arrival, start_m, step, rules, bounds)
                if code == CROWDED:
                    return Stop(FULL, step, -1, ACCEPTED)
                if code == ACCEPTED:
                    gate.next_place[stream] += 1
                    _next_tries(gate, stream, step)
                    last_step = min(last_step, gate.row_due_step[book.used[ROWS] - 1])
                    if gate.asks[0] and stream < SECOND:
                        last_step = min(last_step, step)
                else:
                    gate.try_step[stream] = step + 1
                    if code != WAITS and _is_news(book, gate, stream, arrival, code):
                        return Stop(REFUSED, step, arrival, code)


@kernel
def start_of_m(stream: int, rules: Rules) -> float:
    """Returns the station (m) at which a stream enters."""
    return rules.road.ramp_start_m if stream == RAMP else rules.road.mainline_start_m


@kernel
def _is_as_refused(book: Book, gate: Gate, stream: int, arrival: int) -> bool:
    """Returns whether nothing has changed since an arrival was refused for its own plan's sake."""
    last = gate.refused[stream]
    return bool(
        last[ARRIVAL] == arrival
        and last[CODE] not in (TOO_NEAR, TOO_NEAR_AT_MERGE)
        and last[COMMITMENTS] == book.used[BLOCKS]
        and last[ON_ROAD] == book.used[LIVE] + book.used[INNER]
    )


@kernel
def _is_news(book: Book, gate: Gate, stream: int, arrival: int, code: int) -> bool:
    """Notes a refusal; returns whether the arrival has not been refused for that just before."""
    last = gate.refused[stream]
    news = last[ARRIVAL] != arrival or last[CODE] != code
    last[ARRIVAL], last[CODE] = arrival, code
    on_road = book.used[LIVE] + book.used[INNER]
    last[COMMITMENTS], last[ON_ROAD] = book.used[BLOCKS], on_road
    return bool(news)


@kernel
def enter(
    book: Book,
    record: Record,
    gate: Gate,
    arrival: int,
    station_m: float,
    step: int,
    rules: Rules,
    bounds: Bounds,
) -> int:
    """Puts an arrival on the road, harmonised from there, if the checker agrees.

    Returns ``ACCEPTED``, ``WAITS`` where no way in is safe, ``CROWDED`` where there is no room to
    write it down, or the checker's reason.
    """
    time_s, on_ramp = step * rules.control.step_s, bool(gate.on_ramp[arrival])
    traits, speed_mps = traits_or_usual(gate.traits[arrival], rules), gate.speed_mps[arrival]
    lane = gate.lane[arrival]
    others = ways_of(book)
    if lane > 0:
        others = in_lane(others, lane)
    pieces = plan_entry(
        others,
        traits,
        on_ramp,
        time_s,
        station_m,
        speed_mps,
        0.0 if on_ramp else gate.slowest_mps[0],
        rules,
    )
    if len(pieces) == 0:
        return WAITS
    entry = Entry(time_s, station_m, speed_mps, traits, on_ramp, float(lane))
    code = examine_entry(record, entry, pieces, bounds).code
    if code != ACCEPTED:
        return code
    road = rules.road
    row = commit_entry(
        book,
        record,
        traits,
        on_ramp,
        lane,
        pieces,
        time_s,
        road.mainline_speed_mps,
        road.mainline_end_m,
    )
    if row == NO_ROOM:
        return CROWDED
    gate.row_arrival[row], gate.row_step[row] = arrival, step
    if on_ramp:
        due_s = decision_due_s(pieces, road.decision_station_m)
        gate.row_due_step[row] = max(step, first_step_from(due_s, rules.control.step_s))
    return code
