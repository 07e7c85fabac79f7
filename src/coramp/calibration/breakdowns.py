"""The breakdowns that data shows, each as a stretch of time that may be driven again."""

from collections.abc import Iterator

from coramp.calibration.moments import onset_s
from coramp.calibration.series import Series, queues_of
from coramp.calibration.site import Site

BEFORE_S, AFTER_S = 3600.0, 1200.0
"""How much of the data before and after a breakdown is driven again by candidates."""
LEAST_BEFORE_S = 180.0
MOST = 8
"""More breakdowns than these tell little more."""


def windows_of(data: Series, site: Site, free_mps: float) -> list[Series]:
    """Returns the data around each breakdown before which traffic was free for 3 min or longer."""
    found = []
    for before in _from_queue_to_queue(data, site, free_mps):
        onset = onset_s(before, site, free_mps)
        if onset - before.begin_s >= LEAST_BEFORE_S:
            found.append(before.between(onset - BEFORE_S, onset + AFTER_S))
    return found[:MOST]


def _from_queue_to_queue(data: Series, site: Site, free_mps: float) -> Iterator[Series]:
    """The data of each breakdown, from the end of the queue before to the begin of the next one."""
    coarse = data.coarse()
    queues = queues_of(coarse, site.upstream.id, free_mps)
    for k in range(len(queues)):
        begin = queues[k - 1][1] if k else 0
        end = queues[k + 1][0] if k + 1 < len(queues) else coarse.intervals
        first_s = coarse.begin_s + begin * coarse.interval_s
        yield data.between(first_s, coarse.begin_s + end * coarse.interval_s)
