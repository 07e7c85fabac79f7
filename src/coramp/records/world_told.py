"""What came of a world that fails, in a line."""

from coramp.records.lapses import UNKNOWN, lapses_in
from coramp.records.run import RunRecords

HAPPENED = {
    "vehicle breaks down": ("vehicle broke down", "vehicles broke down"),
    "driver brakes for nothing": ("driver braked for nothing", "drivers braked for nothing"),
    "positioning fails": ("outage of positioning", "outages of positioning"),
    "vehicle falls silent": ("vehicle fell silent", "vehicles fell silent"),
    "vehicle disobeys": ("vehicle disobeyed", "vehicles disobeyed"),
    "vehicle lies": ("vehicle lied about its station", "vehicles lied about their stations"),
}
"""Events of the world itself, one and several of them."""


def told_of_world(run: RunRecords) -> str:
    """Returns messages lost, fallbacks and events of a run, nothing where there were none."""
    row = run.summary
    told = [
        f"{row[f'{what}_lost']} of {row[f'{what}_sent']} {what} lost"
        for what in ("reports", "commands")
        if row.get(f"{what}_lost")
    ]
    if fallbacks := row.get("fallbacks"):
        told.append(f"{fallbacks} fallback{'s' if fallbacks > 1 else ''} on board")
    told += _known(run)
    events = [] if run.safety_events is None else run.safety_events["event"].to_list()
    for event, (one, several) in HAPPENED.items():
        if count := events.count(event):
            told.append(f"{count} {one if count == 1 else several}")
    return ", ".join(told)


def _known(run: RunRecords) -> list[str]:
    """For how long vehicles were not known to the coordinator, and how far it was off at most."""
    told, heard = [], run.heard
    unknown = [lapse for lapse in lapses_in(heard) if lapse.what == UNKNOWN]
    if unknown:
        total_s = sum(lapse.until_s - lapse.from_s for lapse in unknown)
        told.append(f"vehicles not known to the coordinator for {total_s:.1f} s in all")
    most_m = None if heard is None else heard["error_m"].abs().max()
    if isinstance(most_m, float):
        told.append(f"known positions wrong by up to {most_m:.1f} m")
    return told
