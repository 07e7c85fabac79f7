"""How far a calibration is: a bar on a terminal, a line now and then elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from coramp.cli.study_progress import QUIET_REPORT_S


class CalibrationProgress:
    """A bar with the remaining time, or a line now and then where there is no terminal."""

    def __init__(self, total: int, jobs: int) -> None:
        self._console = Console(stderr=True, highlight=False)
        self._bar = Progress(
            TextColumn("runs"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task("runs", total=total)
        self._begun = self._told = time.monotonic()
        self._console.print(f"Up to {total} runs of SUMO, {jobs} at a time")

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

    def __call__(self, done: int, total: int) -> None:
        """Shows that so many runs are done."""
        self._bar.update(self._task, completed=done, total=total)
        now_s = time.monotonic()
        if not self._console.is_terminal and now_s - self._told > QUIET_REPORT_S:
            self._told = now_s
            left_s = (now_s - self._begun) / done * (total - done)
            self._console.print(f"{done} of {total} runs, {left_s:.0f} s left")
