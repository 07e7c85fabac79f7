"""Writing the report or the replay of a folder."""

import shlex
from pathlib import Path

from coramp.agency.before_after import Pairs
from coramp.errors import CorampError
from coramp.records.corridor_run import CorridorRecords, holds_corridor, read_corridor
from coramp.records.files import write_text
from coramp.records.run import RunRecords
from coramp.records.run_folder import MARK, REPLAY, REPORT, read_run
from coramp.records.schemas import Row
from coramp.report.page.corridor_page import corridor_page
from coramp.report.page.corridor_replay import corridor_replay_page
from coramp.report.page.corridor_study_page import corridor_study_page
from coramp.report.page.pages import compared_page, replay_page, run_page
from coramp.report.page.study_page import study_page
from coramp.report.study_folder import is_corridor_study
from coramp.scenarios.toml_files import builtin_names, override_text
from coramp.studies.speed_unit import KMH, MPS
from coramp.studies.store import MARK as STUDY_MARK

GENERATOR = b'<meta name="generator" content="coramp">'
LONGEST_HEAD = 1000
"""Within so many bytes a page says what wrote it."""
HORIZON = "simulation.horizon_s"


def report(
    folder: str | Path,
    against: str | Path | None = None,
    *,
    kmh: bool = False,
) -> Path:
    """Writes ``report.html`` into the folder of a run or a study and returns its path.

    One file that works without a network. ``against`` is the folder of another run on the same
    arrivals, to stand beside a run. With ``kmh`` speeds are in km/h, else in m/s. Raises
    CorampError where there is nothing to report, or that cannot be read or written.
    """
    place = Path(folder)
    target, unit = place / REPORT, KMH if kmh else MPS
    if (place / STUDY_MARK).exists():
        if against is not None:
            raise CorampError("--against: a study compares by itself; give it with a run only")
        of_corridor = is_corridor_study(place)
        _write_page(target, corridor_study_page(place) if of_corridor else study_page(place, unit))
        return target
    if not (place / MARK).exists():
        raise CorampError(
            f"{place}: holds no run and no study; give a folder that coramp run --out or coramp "
            "study has written"
        )
    if holds_corridor(place):
        _write_page(target, corridor_page(_corridors(place, against), unit))
        return target
    stored = [read_run(Path(name)) for name in (place, against) if name is not None]
    page = run_page(stored, stored[0].content["versions"], _repeat(stored), unit)
    _write_page(target, page)
    return target


def replay(folder: str | Path, against: str | Path | None = None) -> Path:
    """Writes ``replay.html`` into the folder of a run and returns its path.

    ``against`` is the folder of another run on the same arrivals, shown beside it. Raises
    CorampError where there is no run, arrivals differ, or it cannot be written.
    """
    target = Path(folder) / REPLAY
    if holds_corridor(Path(folder)):
        _write_page(target, corridor_replay_page(_corridors(folder, against)))
        return target
    runs = [read_run(Path(name)) for name in (folder, against) if name is not None]
    _write_page(target, replay_page(runs))
    return target


def _corridors(folder: str | Path, against: str | Path | None) -> list[CorridorRecords]:
    """The run of a corridor, and another beside it, which must be one too."""
    folders = [Path(name) for name in (folder, against) if name is not None]
    for place in folders[1:]:
        if not holds_corridor(place):
            raise CorampError(
                f"--against: {place}: holds no run of a corridor; allowed is one on the same "
                "arrivals"
            )
    return [read_corridor(place) for place in folders]


def compared(target: Path, pairs: Pairs, *, kmh: bool = False) -> Path:
    """Writes the two-page summary of runs before and after, a pair a seed; returns its path.

    With ``kmh`` speeds are in km/h, else in m/s. Raises CorampError where it cannot be written.
    """
    if target.suffix.lower() != ".html":
        raise CorampError(f"--out: {target}: is no page; allowed are html files")
    _write_page(target, compared_page(pairs, KMH if kmh else MPS))
    return target


def _write_page(target: Path, page: str) -> None:
    """Writes a page; raises CorampError where a file of that name is not one of coramp's pages."""
    try:
        written_by_us = not target.exists() or GENERATOR in target.read_bytes()[:LONGEST_HEAD]
    except OSError:
        written_by_us = False
    if not written_by_us:
        raise CorampError(f"{target}: was not written by coramp; move it, or give it another name")
    write_text(target, page)


def _scenario_file(name: str) -> str:
    return name if name in builtin_names("scenarios") else f"{name}.toml"


def _flows(content: Row) -> list[str]:
    """The options that give the flows; there are none where the scenario says who comes when."""
    if any(content["specification"].get(key) for key in ("arrivals", "demand")):
        return []
    pairs = (("--mainline", "mainline_veh_h"), ("--ramp", "ramp_veh_h"))
    return [word for option, key in pairs for word in (option, f"{content[key]:.12g}")]


def _repeat(stored: list[RunRecords]) -> list[str]:
    """The commands that run it again; a scenario of one's own is taken to lie in NAME.toml."""
    lines = []
    for content in (run.content for run in stored):
        horizon_s = content["specification"]["simulation"]["horizon_s"]
        words = [
            *("coramp", "run", _scenario_file(content["scenario"])),
            *("--strategy", content["strategy"], "--engine", content["engine"]),
            *_flows(content),
            *("--seed", str(content["seed"]), "--horizon", f"{horizon_s:.12g}"),
        ]
        if content["drivers"]:
            words += ["--drivers", content["drivers"]]
        for key, value in content["settings"].items():
            if key != HORIZON:  # is given above
                words += ["--set", override_text(key, value)]
        lines.append(shlex.join(words))
        if content["overrides"] and not content["settings"]:
            lines.append(f"# an older coramp ran it, with {content['overrides']}")
    lines.append("# run.json has the full specification of each run")
    return lines
