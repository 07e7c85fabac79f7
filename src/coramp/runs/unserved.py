"""Says who did not get through in a run, and why, and what drivers were commanded."""

from collections import Counter

import numpy as np

from coramp.records.outcome import Outcome


def unserved_line(outcome: Outcome) -> str | None:
    """Returns in a line how many vehicles had not left at the end and where they are, or None.

    The checker's most frequent reason comes with it, where it refused plans.
    """
    passages = outcome.passages
    left = np.isnan(passages.exit_s)
    if not left.any():
        return None
    outside = int((left & np.isnan(passages.entry_s)).sum())
    line = (
        f"{int(left.sum())} of {len(passages)} vehicles are unserved at {outcome.end_s:g} s, when "
        f"the run was cut off: {outside} wait outside, {int(left.sum()) - outside} on the road"
    )
    if not outcome.refusals:
        return line
    [(reason, _)] = Counter(refusal.reason for refusal in outcome.refusals).most_common(1)
    return f"{line}; plans refused: {len(outcome.refusals)}, most often: {reason}"


def unheeded_line(outcome: Outcome) -> str | None:
    """Returns in a line how many commands nobody could carry out in a run of drivers, or None."""
    if outcome.cooperative or not outcome.interventions:
        return None
    return (
        f"{outcome.interventions} commands were refused: drivers take none; allowed is to set the "
        "ramp's signal, where the strategy is metered"
    )
