"""What a run keeps of its decisions: those that were explained, and what the checker refused."""

from collections.abc import Sequence
from dataclasses import dataclass

from coramp.checker.checker import Verdict
from coramp.checker.reasons import REASONS, TOO_NEAR, TOO_NEAR_AT_MERGE
from coramp.strategies.attempts import Attempt
from coramp.strategies.base import Decision, Explanation, FollowTrajectory


@dataclass(frozen=True, slots=True)
class DecisionRecord:
    """One explained decision, with what the checker measured of it."""

    time_s: float
    explanation: Explanation
    adjusted_rows: tuple[int, ...]
    min_margin_m: float


@dataclass(frozen=True, slots=True)
class Refusal:
    """A plan that the checker did not let pass; the vehicles kept their commitments.

    ``other_row`` is the vehicle that it came too near to, by ``missing_m``; -1 and None for none.
    ``tried`` is what had been tried for a plan, its last attempt the one refused. It is None for
    entries, and where the plan before of the vehicle was refused for the same reason.
    """

    time_s: float
    row: int
    reason: str
    other_row: int = -1
    missing_m: float | None = None
    tried: Sequence[Attempt] | None = None


class DecisionLog:
    """Collects explained decisions and refusals; a plan needs ``allowance_m`` beyond Eq. 1."""

    def __init__(self, allowance_m: float) -> None:
        self.decisions: list[DecisionRecord] = []
        self.refusals: list[Refusal] = []
        self._allowance_m = allowance_m
        self._last_refused: dict[int, tuple[int, int]] = {}

    def note_decision(
        self,
        decision: Decision,
        trajectories: Sequence[FollowTrajectory],
        time_s: float,
        margin_m: float,
    ) -> None:
        """Notes what a decision explains, with the trajectories that were committed for it."""
        for explanation in decision.explanations:
            adjusted = tuple(c.row for c in trajectories if c.row != explanation.row)
            self.decisions.append(DecisionRecord(time_s, explanation, adjusted, margin_m))

    def note_refused_entry(self, row: int, code: int, time_s: float) -> None:
        """Notes an entry, or a stop further ahead, that the checker refused by this reason."""
        self.refusals.append(Refusal(time_s, row, REASONS[code]))

    def note_refused_plan(
        self, decision: Decision, subjects: Sequence[int], verdict: Verdict, time_s: float
    ) -> None:
        """Notes for each subject of a decision why the checker refused its trajectories."""
        tried = {told.row: told.tried for told in decision.explanations}
        too_near = verdict.code in (TOO_NEAR, TOO_NEAR_AT_MERGE)
        missing_m = self._allowance_m - verdict.least_margin_m if too_near else None
        cause = (verdict.code, verdict.other_row)
        for row in subjects:
            again = self._last_refused.get(row) == cause
            self._last_refused[row] = cause
            self.refusals.append(
                Refusal(
                    time_s,
                    row,
                    REASONS[verdict.code],
                    verdict.other_row,
                    missing_m,
                    None if again else tried.get(row, ()),
                )
            )
