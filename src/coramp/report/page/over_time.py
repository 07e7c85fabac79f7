"""Speed and delay over time as parts of a page."""

from collections.abc import Sequence

from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.report.over_time_figure import delays_over_time_figure, speeds_over_time_figure
from coramp.report.page.svg import picture
from coramp.studies.overrides import scenario_value
from coramp.studies.setting_words import settings_text
from coramp.studies.speed_unit import MPS, SpeedUnit

HORIZON = "simulation.horizon_s"


def setting_of_run(run: RunRecords, keys: Sequence[str] = ()) -> str:
    """Returns the flows and settings of a run in words, and its seed; the horizon is no setting.

    Of ``keys`` that the run does not set, the value of its scenario is told.
    """
    scenario = run.scenario.model_dump(mode="json")
    given = {k: v for k, v in run.content["settings"].items() if k != HORIZON}
    own = {k: v for k in keys if (v := scenario_value(scenario, k)) is not None}
    settings = settings_text({**own, **given}, scenario)
    return ", ".join(part for part in (run.flows, settings, f"seed {run.summary['seed']}") if part)


def over_time_pictures(
    runs: Sequence[RunRecords],
    unit: SpeedUnit = MPS,
    keys: Sequence[str] = (),
    place: str = "",
) -> list[Row]:
    """Returns speed and delay over time of runs on the same arrivals, as parts of a page.

    ``keys`` are the settings that captions tell in any case, ``place`` which of a study's settings
    these are.
    """
    at = f" at {', '.join(part for part in (setting_of_run(runs[0], keys), place) if part)}"
    return [
        picture(f"Mean speed over time{at}", speeds_over_time_figure(runs, unit)),
        picture(f"Mean delay over time{at}", delays_over_time_figure(runs)),
    ]
