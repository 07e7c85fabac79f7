"""The replay of a corridor's run: the road as it lies, with all of its sites."""

from collections.abc import Sequence

from coramp.records.corridor_run import CorridorRecords
from coramp.report.page.assemble import packed_data, plain
from coramp.report.page.corridor_page import check_same_vehicles, subtitle_of, title_of
from coramp.report.page.corridor_shown import corridor_data

SCRIPTS = ("motion.js", "looks.js", "corridor.js")


def corridor_replay_page(runs: Sequence[CorridorRecords]) -> str:
    """Returns a page with the replay of runs on the same arrivals, one below the other.

    Raises CorampError where arrivals differ, and where no positions were kept.
    """
    check_same_vehicles(runs)
    return plain(
        "replay.html",
        SCRIPTS,
        title=f"Replay: {' against '.join(map(title_of, runs))}",
        subtitle=subtitle_of(runs[0]),
        runs={f"run-{k}": packed_data(corridor_data(run)) for k, run in enumerate(runs)},
    )
