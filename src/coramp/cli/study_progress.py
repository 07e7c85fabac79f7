"""How far a study is: a bar on a terminal, a line now and then elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from coramp.cli.console import counted
from coramp.studies.runner import Progress as StudyState
from coramp.studies.tables import number

QUIET_REPORT_S = 10.0
"""How often progress is told where there is no terminal to draw a bar on."""


class StudyProgress:
    """A bar with rate and remaining time, or a line now and then where there is no terminal."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, highlight=False)
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[last]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task("runs", total=None, rate="", last="")
        self._told = time.monotonic()
        self._first: tuple[int, float] | None = None

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def __call__(self, state: StudyState) -> None:
        """Shows how far the study is."""
        if state.last is None:
            self._begin(state)
            return
        rate = self._rate(state.done)
        finished = state.skipped + state.done
        failed = f", {state.failed} failed" if state.failed else ""
        self._bar.update(
            self._task,
            completed=finished,
            total=state.total,
            rate=f"{f'{rate:.1f}/s' if rate else ''}{failed}",
            last=_last(state),
        )
        if not self._console.is_terminal and (
            finished == state.total or time.monotonic() - self._told > QUIET_REPORT_S
        ):
            self._told = time.monotonic()
            left_s = (state.total - finished) / rate if rate else 0.0
            left = f", {rate:.1f}/s, {left_s:.0f} s left" if rate else ""
            self._console.print(f"{finished} of {state.total} runs{failed}{left}")

    def _rate(self, done: int) -> float:
        """Runs a second since the first was done: that one may have waited for compiling."""
        now_s = time.monotonic()
        if self._first is None:
            self._first = done, now_s
        runs, since_s = self._first
        if done == runs:
            return 0.0
        return (done - runs) / (now_s - since_s) if now_s > since_s else 0.0

    def _begin(self, state: StudyState) -> None:
        self._told, self._first = time.monotonic(), None
        if state.skipped:
            self._console.print(f"{state.skipped} of {state.total} runs are there already")
        if state.damaged:
            self._console.print(f"{counted(state.damaged, 'result')} found damaged, to run again")
        self._bar.update(self._task, completed=state.skipped, total=state.total)


def _last(state: StudyState) -> str:
    if state.last is None:
        return ""
    run = state.last.run
    flows = f"{run['mainline_veh_h']:g}+{run['ramp_veh_h']:g}"
    delays = f"{number(run['mainline_delay_s'])}/{number(run['ramp_delay_s'])} s"
    return f"{run['strategy']} {flows}: {delays if run['status'] == 'ok' else run['error']}"
