"""Who was on which lane of a mainline of several, as pages take it."""

from collections.abc import Mapping

from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.report.lane_stays import made_way_in, stays_of


def lanes_data(run: RunRecords, place_of: Mapping[str, int]) -> Row:
    """Returns what the page's scripts take of lanes; nothing where the mainline has one.

    ``lanes`` has for each vehicle the times (s) at which it came to a lane, and that lane: 0 next
    to the ramp, -1 on the ramp and its acceleration lane. ``made_way`` has who made way, and when;
    None where nobody is automated.
    """
    if run.scenario.mainline.lanes == 1:
        return {}
    found: list[list[float]] = [[] for _ in place_of]
    for name, time_s, lane in stays_of(run).iter_rows():
        found[place_of[name]] += [round(time_s, 3), lane]
    made_way = made_way_in(run)
    return {
        "lanes": found,
        "made_way": None
        if made_way is None
        else [[place_of[name], round(time_s, 3)] for name, time_s, _ in made_way.iter_rows()],
    }
