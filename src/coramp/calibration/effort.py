"""How much a calibration simulates, and whom it tells how far it is."""

from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class Counter:
    """Counts runs; ``report`` is told after each how many of how many are done."""

    total: int
    report: Callable[[int, int], None] = lambda _done, _total: None
    done: int = 0

    def one_more(self) -> None:
        """Counts a run."""
        self.done += 1
        self.report(self.done, self.total)


@dataclass(frozen=True)
class Effort:
    """How much is simulated: ``runs`` of the search, through ``seeds`` by turns, ``jobs`` at once.

    ``speed_runs`` look at desired speeds each of two times, ``fit_runs`` at the fit of what was
    found.
    """

    runs: int = 120
    seeds: int = 16
    jobs: int = 2
    speed_runs: int = 12
    fit_runs: int = 8
    counter: Counter = field(default_factory=lambda: Counter(0))

    @property
    def total(self) -> int:
        """How many runs a calibration takes at most."""
        return self.runs + 2 * self.speed_runs + self.fit_runs

    def told_to(self, report: Callable[[int, int], None]) -> "Effort":
        """Returns the same, that tells somebody how far it is."""
        told = Counter(self.total, report)
        return Effort(self.runs, self.seeds, self.jobs, self.speed_runs, self.fit_runs, told)
