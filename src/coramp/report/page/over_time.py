"""Speed and delay over time as parts of a page."""

from collections.abc import Sequence

from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.report.over_time_figure import delays_over_time_figure, speeds_over_time_figure
from coramp.report.page.svg import picture
from coramp.studies.speed_unit import MPS, SpeedUnit


def over_time_pictures(runs: Sequence[RunRecords], unit: SpeedUnit = MPS) -> list[Row]:
    """Returns speed and delay over time of runs on the same arrivals, as parts of a page."""
    setting = runs[0].content["overrides"]
    at = f" at {runs[0].flows}" + (f", {setting}" if setting else "")
    return [
        picture(f"Mean speed over time{at}", speeds_over_time_figure(runs, unit)),
        picture(f"Mean delay over time{at}", delays_over_time_figure(runs)),
    ]
