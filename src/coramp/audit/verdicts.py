"""What an audit says: one verdict a claim, and for each contradiction the row and why."""

from dataclasses import dataclass
from pathlib import Path

from coramp.messages.log_reader import MessageLog

CONFIRMED, CONTRADICTED, UNCHECKED = "confirmed", "contradicted", "not checked"
MOST_TOLD = 5
"""So many contradictions of one claim are told; the others are counted."""


@dataclass(frozen=True)
class Finding:
    """A contradiction: what a message, or a figure, says against what; without a row, of no one."""

    against: str
    text: str
    row: int | None = None
    time_s: float | None = None
    vehicle_id: str | None = None
    kind: str | None = None

    @property
    def line(self) -> str:
        """The contradiction in one line."""
        if self.row is None:
            return f"{self.text}; contradicts {self.against}"
        about = f", {self.vehicle_id}" if self.vehicle_id is not None else ""
        place = f"row {self.row} ({self.time_s:.3f} s{about}, {self.kind})"
        return f"{place}: {self.text}; contradicts {self.against}"


@dataclass(frozen=True)
class Check:
    """One claim of the run, the verdict on it, and how it was come by."""

    claim: str
    verdict: str
    how: str
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class Audit:
    """All that was checked of a run."""

    folder: Path
    checks: tuple[Check, ...]

    @property
    def contradictions(self) -> list[Finding]:
        """All contradictions that are told, in the order of the checks."""
        return [finding for check in self.checks for finding in check.findings]

    @property
    def holds(self) -> bool:
        """Whether nothing contradicts."""
        return all(check.verdict != CONTRADICTED for check in self.checks)


def finding(log: MessageLog, row: int, against: str, text: str) -> Finding:
    """Returns a contradiction of a row of the log."""
    said = log.frame.row(row, named=True)
    return Finding(
        against, text, int(log.places[row]), said["time_s"], said["vehicle_id"], said["kind"]
    )


def judged(claim: str, how: str, findings: list[Finding]) -> Check:
    """Returns a claim confirmed, or contradicted by the findings."""
    told = tuple(findings[:MOST_TOLD])
    if len(findings) > len(told):
        how += f"; {len(findings) - len(told)} more contradictions"
    return Check(claim, CONTRADICTED if findings else CONFIRMED, how, told)


def unchecked(claim: str, why: str) -> Check:
    """Returns a claim that could not be checked."""
    return Check(claim, UNCHECKED, why)
