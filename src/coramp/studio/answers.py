"""What the studio's page is told: runs as they are drawn, their figures, and a scenario to keep."""

import json
import math
from collections import OrderedDict
from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock, Thread

import tomli_w

from coramp.errors import CorampError
from coramp.records.schemas import Row
from coramp.report.page.assemble import assembled
from coramp.report.page.pages import answer, comparison_table, notes
from coramp.report.page.shown import called, title_of
from coramp.report.style import look_of
from coramp.road.streams import STREAMS
from coramp.runs.running import RunSpec, recorded
from coramp.scenarios.listed import FLOWS
from coramp.scenarios.measured import COUNTS, DEMAND
from coramp.studies.tables import Table
from coramp.studio.dials import AUTOMATION, DECIDING, NOTHING, Studio
from coramp.studio.process import Played, Simulated, SumoProcesses, played_from
from coramp.studio.world import by_kind, folded, preset_words, world_of

KEPT_RUNS = 16
"""So many runs are remembered, so that going back to one shows it at once."""
TICK_S = 0.1
"""How often a page that waits is told how far its runs are."""


@dataclass
class Job:
    """A run that is asked for: how many wait for it, and how far it is in SUMO."""

    spec: RunSpec
    waiting: int = 0
    at: Simulated | None = None
    played: "Future[Played]" = field(default_factory=Future)

    def progress(self) -> Row:
        """Returns for the page which run this is, how far it is and which share that is."""
        spec, horizon_s = self.spec, self.spec.scenario.simulation.horizon_s
        time_s = 0.0 if self.at is None else self.at.time_s
        if self.played.done():
            told = "done"
        elif self.at is None:
            told = "SUMO starts"
        elif time_s == math.inf:
            told = "simulated; figures are worked out"
        elif time_s < horizon_s:
            told = f"{time_s:.0f} of {horizon_s:.0f} s simulated"
        else:
            told = f"{time_s:.0f} s simulated; the last vehicles leave"
        share = 1.0 if self.played.done() else min(1.0, time_s / horizon_s)
        title = called(spec.strategy, spec.drivers, spec.scenario)
        return {"title": title, "told": told, "share": share}


@dataclass
class Answers:
    """Answers a studio's page, several questions at a time; remembers the last runs."""

    studio: Studio
    _lock: Lock = field(default_factory=Lock)
    _processes: SumoProcesses = field(default_factory=SumoProcesses)
    _kept: OrderedDict[str, Job] = field(default_factory=OrderedDict)

    @property
    def saved_name(self) -> str:
        """What a scenario is called that is saved here, as its file is."""
        name = f"{self.studio.scenario.name}-studio"
        return "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "-" for c in name)

    def page(self) -> str:
        """Returns the page, with its dials where the scenario has them."""
        studio = self.studio
        return assembled(
            "studio.html",
            ("studio.js",),
            (studio.scenario,),
            title=f"Studio: {studio.scenario.name}",
            subtitle=studio.scenario.description,
            dials=[dial for dial in studio.dials if dial.name in DECIDING],
            folded=[dial for dial in studio.dials if dial.name not in DECIDING],
            chosen=studio.chosen,
            start=studio.start,
            choices=[(name, _called(name)) for name in studio.choices],
            among=studio.among_drivers,
            presets=preset_words(studio.scenario),
            drivers=list(studio.scenario.drivers),
            nothing=NOTHING,
            runs={},
            cells=[],
        )

    def runs(self, asked: Mapping[str, str]) -> str:
        """Returns JSON of the runs that are asked for, or of ``errors``; waits for them."""
        *_, last = self.lines(asked)
        return last

    def lines(self, asked: Mapping[str, str]) -> Generator[str]:
        """Yields lines of JSON: ``progress`` while SUMO runs, and the runs or ``errors`` at last.

        A run in SUMO for which nobody waits any more is killed: close the iterator to leave it.
        """
        jobs: list[Job] = []
        try:
            specs = self.studio.specs(asked)
            in_sumo_first = sorted(specs, key=lambda spec: spec.engine != "sumo")
            jobs.extend(self._joined(spec) for spec in in_sumo_first)
            while not _are_done(jobs):
                yield json.dumps({"progress": [job.progress() for job in jobs]})
                wait([job.played for job in jobs], TICK_S, FIRST_EXCEPTION)
            played = {job.spec.run_id: job.played.result() for job in jobs}
            yield self._told(specs, [played[spec.run_id] for spec in specs])
        except CorampError as error:
            yield json.dumps({"errors": [_plain(line) for line in error.messages]})
        finally:
            self._leave(jobs)

    def get_ready(self) -> None:
        """Computes the first picture, and starts the processes that runs in SUMO will need."""
        self.runs({})
        self._processes.get_ready()

    def close(self) -> None:
        """Ends the processes of runs in SUMO."""
        self._processes.close()

    def _told(self, specs: Sequence[RunSpec], found: Sequence[Played]) -> str:
        runs = [run for run, _ in found]
        kinds = by_kind(runs)
        figures, more = folded(comparison_table(runs))
        told = {
            "world": [{"title": title_of(run), "told": world_of(run)} for run in runs],
            "answer": " ".join(map(answer, runs)),
            "notes": [line for run in runs for line in notes(run)],
            "moved": _moved(specs[0]),
            "tables": [_as_data(table) for table in (kinds, figures) if table],
            "folded": [_as_data(more)] if more.rows else [],
            "command": self._command(specs[0]),
        }
        return f'{json.dumps(told)[:-1]}, "runs": [{",".join(text for _, text in found)}]}}'

    def scenario_toml(self, asked: Mapping[str, str]) -> str:
        """Returns the scenario as it is set, to be kept; raises CorampError if it is not valid."""
        spec = self.studio.specs(asked)[0]
        content = spec.scenario.model_dump(mode="json", exclude_none=True, exclude={"arrivals"})
        content["name"] = self.saved_name
        self._leave_out_what_demand_says(content)
        return (
            f"# Set in coramp studio; run it by\n# {self._command(spec)}\n{tomli_w.dumps(content)}"
        )

    def _leave_out_what_demand_says(self, content: Row) -> None:
        """Takes out of a scenario what follows from its counts, or from its demand over time."""
        counts = content.get(COUNTS)
        if counts:
            beside = Path(self.studio.source).absolute().parent
            counts["file"] = str(beside / counts["file"])
            del content[DEMAND]
        if counts or content.get(DEMAND):
            for stream in STREAMS:
                for key in FLOWS:
                    content[stream].pop(key, None)

    def _joined(self, spec: RunSpec) -> Job:
        """Returns a run's job, for which one more waits; begins it unless it is under way.

        The exact engine runs at once, in this thread. SUMO runs in a process of its own.
        """
        with self._lock:
            found = self._kept.get(spec.run_id)
            job = found or Job(spec)
            job.waiting += 1
            self._kept[spec.run_id] = job
            self._kept.move_to_end(spec.run_id)
            while len(self._kept) > KEPT_RUNS:
                self._kept.popitem(last=False)
        if found is None:
            if spec.engine == "sumo":
                Thread(target=self._play, args=(job,), daemon=True).start()
            else:
                self._play(job)
        return job

    def _leave(self, jobs: Sequence[Job]) -> None:
        with self._lock:
            for job in jobs:
                job.waiting -= 1

    def _play(self, job: Job) -> None:
        """Makes the run of a job, and forgets it unless it succeeds."""

        def tell(at: Simulated) -> None:
            job.at = at

        try:
            if job.spec.engine == "sumo":
                played = self._processes.run(job.spec, tell, lambda: self._is_wanted(job))
            else:
                played = played_from(recorded(job.spec))
            job.played.set_result(played)
        except BaseException as error:
            with self._lock:
                self._forget(job)
            job.played.set_exception(error)
            if not isinstance(error, Exception):
                raise

    def _is_wanted(self, job: Job) -> bool:
        """Whether somebody waits for a run; if not, nobody can any more."""
        with self._lock:
            if not job.waiting:
                self._forget(job)
            return job.waiting > 0

    def _forget(self, job: Job) -> None:
        if self._kept.get(job.spec.run_id) is job:
            del self._kept[job.spec.run_id]

    def _command(self, spec: RunSpec) -> str:
        drivers = f" --drivers {spec.drivers}" if spec.drivers else ""
        return (
            f"coramp run {self.saved_name}.toml --strategy {spec.strategy} "
            f"--engine {spec.engine}{drivers} --seed {spec.seed}"
        )


def _are_done(jobs: Sequence[Job]) -> bool:
    """Whether all runs are made; raises what went wrong with one, whatever the others do."""
    done = [job.played for job in jobs if job.played.done()]
    for played in done:
        played.result()
    return len(done) == len(jobs)


def _as_data(table: Table) -> Row:
    return {"title": table.title, "columns": table.columns, "rows": table.rows}


def _called(choice: str) -> str:
    """What a choice is called in figures and in the replay."""
    if choice == AUTOMATION:
        return "automation alone"
    strategy, _, drivers = choice.partition(":")
    return look_of(strategy, drivers or None).label


def _plain(line: str) -> str:
    return line.removeprefix("studio: ")


def _moved(spec: RunSpec) -> list[str]:
    """What followed what was set, in words."""
    told = {
        "ramp.decision_station_m": "the decision station to {:g} m",
        "motion.free_acceleration_mps2": "the ordinary acceleration to {:g} m/s²",
    }
    return [told[key].format(value) for key, value in spec.overrides if key in told]
