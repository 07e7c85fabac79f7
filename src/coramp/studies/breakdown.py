"""Where the merge breaks down: by bisection over the mainline flow, seed by seed."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from coramp.errors import CorampError
from coramp.runs.running import RunSpec
from coramp.studies.definition import Search, Study, spec_of, variants

BREAKDOWN_DELAY_S = 5.0
"""A stream that loses more than this on average, or leaves anyone behind, no longer merges."""


def broke_down(run: Mapping[str, Any]) -> bool:
    """Returns whether a run's streams lose more than 5 s on average, or anyone is left behind."""
    delays_s = (run["mainline_delay_s"] or 0.0, run["ramp_delay_s"] or 0.0)
    return max(delays_s) > BREAKDOWN_DELAY_S or run["unserved"] > 0


@dataclass(frozen=True)
class Bisection:
    """One search: where between two flows does one combination break down, with one seed?"""

    search: Search
    first: RunSpec

    def next_run(self, result_of: Callable[[RunSpec], Mapping[str, Any] | None]) -> RunSpec | None:
        """Returns the run whose result is needed next, None once the search has ended.

        ``result_of`` gives a run's row, None for one that is not done. A run that failed ends it.
        The ends of the range are run only where everything between them broke down, or nothing did:
        far beyond the limit runs take longest.
        """
        low, high = -1, self.search.steps + 1
        while high - low > 1:
            middle = (low + high) // 2
            broken = self._broken(middle, result_of)
            if broken is None:
                return self._unless_failed(middle, result_of)
            low, high = (low, middle) if broken else (middle, high)
        return None

    def so_far(
        self, result_of: Callable[[RunSpec], Mapping[str, Any] | None]
    ) -> tuple[list[RunSpec], int]:
        """Returns the runs that the search rests on so far, and how many more it takes at most."""
        taken: dict[str, RunSpec] = {}

        def noted(spec: RunSpec) -> Mapping[str, Any] | None:
            result = result_of(spec)
            if result is not None:
                taken[spec.run_id] = spec
            return result

        ended = self.next_run(noted) is None
        return list(taken.values()), 0 if ended else self.search.runs_at_most - len(taken)

    def spec_at(self, step: int) -> RunSpec:
        """Returns the run at one of the search's flows."""
        scenario = self.first.scenario
        mainline = scenario.mainline.model_copy(update={"flow_veh_h": self.search.flow_veh_h(step)})
        return replace(self.first, scenario=scenario.model_copy(update={"mainline": mainline}))

    def _broken(
        self, step: int, result_of: Callable[[RunSpec], Mapping[str, Any] | None]
    ) -> bool | None:
        run = result_of(self.spec_at(step))
        return None if run is None or run["status"] != "ok" else broke_down(run)

    def _unless_failed(
        self, step: int, result_of: Callable[[RunSpec], Mapping[str, Any] | None]
    ) -> RunSpec | None:
        spec = self.spec_at(step)
        return spec if result_of(spec) is None else None


def bisections(study: Study, seeds: int, label: str) -> list[Bisection]:
    """Returns all searches of a study; raises CorampError for what cannot be run."""
    found: list[Bisection] = []
    problems: dict[str, None] = {}
    for search in study.searches:
        for arguments in _arguments(search):
            try:
                for flow in (search.mainline_to_veh_h, search.mainline_from_veh_h):
                    first = spec_of(study, {**arguments, "mainline_veh_h": flow})
            except CorampError as error:
                problems.update(dict.fromkeys(error.messages))
                continue
            found += [Bisection(search, replace(first, seed=seed)) for seed in range(1, seeds + 1)]
    if problems:
        raise CorampError(*(f"{label}: {problem}" for problem in problems))
    return found


def _arguments(search: Search) -> Iterator[dict[str, Any]]:
    for variant in variants(search):
        for ramp in search.ramp_veh_h:
            yield {**variant, "ramp_veh_h": ramp}
