"""All figures: the paper's, from our runs, and ours; as SVG and PNG files."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from coramp.records.files import made_folder
from coramp.records.run import RunRecords
from coramp.report.baseline_figure import baseline_figure
from coramp.report.capacity_figure import capacity_figure
from coramp.report.field_figure import field_figure
from coramp.report.flow_figures import delay_figure, gain_figure, rung_figure
from coramp.report.formula_figures import collision_figure, fuel_figure
from coramp.report.front_figure import front_figure
from coramp.report.hostile_figure import hostile_figure
from coramp.report.penetration_figure import penetration_figure
from coramp.report.road_figure import road_figure
from coramp.report.run_figures import margin_figure, speed_figure
from coramp.report.sensitivity_figure import sensitivity_figure
from coramp.report.study_folder import StoredStudy
from coramp.report.style import save_figure
from coramp.report.worked_example import positions_figure, time_space_figure
from coramp.runs.planning import plan_snapshot
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.snapshots import load_snapshot

FORMATS = ("svg", "png")
SCENARIO, EXAMPLE = "paper", "example"
LONG_STUDIES = {
    "capacity": {"capacity": capacity_figure},
    "field": {"field": field_figure, "field-front": front_figure},
    "baseline": {"baseline": baseline_figure},
    "penetration": {"penetration": penetration_figure},
    "hostile": {"hostile": hostile_figure},
}
"""Figures of studies that take some ten minutes; they are drawn where the study is given."""
LEFT_OUT = (
    "not drawn: {}; their studies take some ten minutes and more: run coramp study NAME, then add "
    "--study out/NAME"
)


@dataclass(frozen=True)
class FigureSet:
    """The figures that were drawn: each name with its files, and what is to be said of them."""

    folder: Path
    files: Mapping[str, tuple[Path, ...]]
    notes: tuple[str, ...]


def save_figures(
    folder: Path, studies: Mapping[str, StoredStudy], runs: Sequence[RunRecords]
) -> FigureSet:
    """Writes every figure into a folder, in each of the formats.

    ``studies`` are by layout: ``paper`` and ``sensitivity`` must be there, others may.
    Raises CorampError where a file cannot be written.
    """
    made_folder(folder)
    files = {}
    for name, draw in _catalogue(studies, runs):
        figure = draw()
        files[name] = tuple(save_figure(figure, folder / f"{name}.{end}") for end in FORMATS)
    notes = [
        f"{stored.failed} runs of {stored.folder} failed and are not drawn"
        for stored in studies.values()
        if stored.failed
    ]
    if left_out := [layout for layout in LONG_STUDIES if layout not in studies]:
        notes.append(LEFT_OUT.format(", ".join(left_out)))
    return FigureSet(folder, files, tuple(notes))


def _catalogue(
    studies: Mapping[str, StoredStudy], runs: Sequence[RunRecords]
) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Every figure's name with what draws it, in the order of the paper, then ours."""
    scenario, snapshot = load_scenario(SCENARIO), load_snapshot(EXAMPLE)
    mainline = plan_snapshot(snapshot, "mainline-priority")
    ramp = plan_snapshot(snapshot, "ramp-priority")
    by_flow = studies["paper"].runs
    yield "fig04-collision-acceleration", collision_figure
    yield "fig06-09-positions", lambda: positions_figure(mainline, ramp)
    yield "fig07-11-time-space", lambda: time_space_figure(mainline)
    yield "fig13-road", lambda: road_figure(scenario)
    yield "fig14-mainline-speed", lambda: speed_figure(runs, "mainline")
    yield "fig15-ramp-speed", lambda: speed_figure(runs, "ramp")
    yield "fig16-fuel", fuel_figure
    yield "delay-by-flow", lambda: delay_figure(by_flow)
    yield "gain-by-flow", lambda: gain_figure(by_flow)
    yield "rungs-by-flow", lambda: rung_figure(by_flow)
    yield "margins", lambda: margin_figure(runs, scenario.safety.execution_allowance_m)
    yield "sensitivity", lambda: sensitivity_figure(studies["sensitivity"].runs)
    for layout, drawn in LONG_STUDIES.items():
        if layout in studies:
            for name, draw in drawn.items():
                yield name, partial(draw, studies[layout].runs)
