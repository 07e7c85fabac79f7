"""What the studio's page is told: runs as they are drawn, their figures, and a scenario to keep."""

import json
from collections import OrderedDict
from collections.abc import Mapping
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import dataclass, field
from threading import Lock

import tomli_w

from coramp.errors import CorampError
from coramp.records.run import RunRecords
from coramp.report.page.assemble import assembled
from coramp.report.page.pages import answer, comparison_table, notes
from coramp.report.page.shown import page_data
from coramp.report.style import look_of
from coramp.runs.running import RunSpec, recorded
from coramp.studio.dials import DECIDING, NOTHING, Studio

Played = tuple[RunRecords, str]
"""A run, and what the page's scripts take for it."""
KEPT_RUNS = 16
"""So many runs are remembered, so that going back to one shows it at once."""


@dataclass
class Answers:
    """Answers a studio's page, several questions at a time; remembers the last runs."""

    studio: Studio
    _lock: Lock = field(default_factory=Lock)
    _sumo: Lock = field(default_factory=Lock)
    _kept: OrderedDict[str, "Future[Played]"] = field(default_factory=OrderedDict)

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
            title=f"Studio: {studio.scenario.name}",
            subtitle=studio.scenario.description,
            dials=[dial for dial in studio.dials if dial.name in DECIDING],
            folded=[dial for dial in studio.dials if dial.name not in DECIDING],
            chosen=studio.chosen,
            start=studio.start,
            choices=[(name, _called(name)) for name in studio.choices],
            nothing=NOTHING,
            runs={},
            cells=[],
        )

    def runs(self, asked: Mapping[str, str]) -> str:
        """Returns JSON of the runs that are asked for, or of ``errors``."""
        try:
            specs = self.studio.specs(asked)
            found = [self._run(spec) for spec in specs]
        except CorampError as error:
            return json.dumps({"errors": [_plain(line) for line in error.messages]})
        runs = [run for run, _ in found]
        table = comparison_table(runs)
        told = {
            "answer": " ".join(map(answer, runs)),
            "notes": [line for run in runs for line in notes(run)],
            "moved": _moved(specs[0]),
            "table": {"title": table.title, "columns": table.columns, "rows": table.rows},
            "command": self._command(specs[0]),
        }
        return f'{json.dumps(told)[:-1]}, "runs": [{",".join(text for _, text in found)}]}}'

    def scenario_toml(self, asked: Mapping[str, str]) -> str:
        """Returns the scenario as it is set, to be kept; raises CorampError if it is not valid."""
        spec = self.studio.specs(asked)[0]
        content = spec.scenario.model_dump(mode="json", exclude_none=True, exclude={"arrivals"})
        content["name"] = self.saved_name
        return (
            f"# Set in coramp studio; run it by\n# {self._command(spec)}\n{tomli_w.dumps(content)}"
        )

    def _run(self, spec: RunSpec) -> Played:
        """Returns a run; who asks for one that is under way waits for it, and nobody else does."""
        with self._lock:
            found = self._kept.get(spec.run_id)
            asked = found or Future[Played]()
            self._kept[spec.run_id] = asked
            self._kept.move_to_end(spec.run_id)
            while len(self._kept) > KEPT_RUNS:
                self._kept.popitem(last=False)
        if found is None:
            try:
                asked.set_result(self._played(spec))
            except BaseException as error:
                asked.set_exception(error)
                with self._lock:
                    self._kept.pop(spec.run_id, None)
                raise
        return asked.result()

    def _played(self, spec: RunSpec) -> Played:
        # There is one SUMO in a process; the exact engine can run any number of times at once.
        with self._sumo if spec.engine == "sumo" else nullcontext():
            run = recorded(spec)
        return run, json.dumps(page_data(run), separators=(",", ":"), allow_nan=False)

    def _command(self, spec: RunSpec) -> str:
        drivers = f" --drivers {spec.drivers}" if spec.drivers else ""
        return (
            f"coramp run {self.saved_name}.toml --strategy {spec.strategy} "
            f"--engine {spec.engine}{drivers} --seed {spec.seed}"
        )


def _called(choice: str) -> str:
    """What a choice is called in figures and in the replay."""
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
