"""The summary that prints on two pages: words and a table, then speeds and queues over time."""

import math
from collections.abc import Iterator, Sequence

from coramp.agency.before_after import Change, Measured, Pairs, changes
from coramp.agency.figures import FIGURES
from coramp.records.schemas import Row
from coramp.report.contour_figure import contour_figure, queue_figure
from coramp.report.page.shown import title_of
from coramp.report.page.svg import picture
from coramp.road.streams import STREAMS
from coramp.scenarios.demand_sections import peak_veh_h
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.tables import Table, number, with_interval

BEFORE, AFTER = "before", "after"
LETTER = "level of service of the merge (A best, F broken down)"
MEANING = (
    "Total time spent is the time of all vehicles from when they were due until they left, waiting "
    "included. A mile and lane is a mile of one lane; a truck counts as two cars. Congested is the "
    "mainline where vehicles drive below 75 % of free flow."
)
ONE_SEED = (
    "This is one draw of arrivals. Another draw gives other figures: with several seeds, coramp "
    "compare tells how sure the difference is."
)


NO_BREAKDOWN = "Traffic does not break down"
SPEEDS = "Speed on the mainline ({}): vehicles drive upwards, red is slow"
ALL_LANES = "mean of all {} lanes"
SEVERAL_LANES = (
    "Several mainline lanes count together: congested is where their mean speed is that low. The "
    "density of the merge is that of its lane and the two mainline lanes next to it."
)
QUEUED = "Queues over time ({})"


def summary_of(runs: Sequence[Measured], unit: SpeedUnit = MPS) -> Row:
    """Returns the summary of one run, or of one and what was before it, as a page takes it."""
    if len(runs) == 1:
        return _part(_words_of_one(runs[0]), _table_of_one(runs[0]), runs, unit)
    after, before = runs
    return summary_of_pairs([(before, after)], unit)


def summary_of_pairs(pairs: Pairs, unit: SpeedUnit = MPS) -> Row:
    """Returns the summary of runs before and after, a pair a seed; pictures are of the first."""
    found = changes(pairs)
    return _part(_words(pairs, found), _table(pairs, found), pairs[0], unit)


def before_after_table(pairs: Pairs) -> Table:
    """Returns the figures before and after, and the differences, of a pair a seed."""
    return _table(pairs, changes(pairs))


def names_of(runs: Sequence[Measured]) -> list[str]:
    """Returns what the runs are called in pictures: of two, which is before and which after."""
    names = [title_of(measured.run) for measured in runs]
    if len(runs) == 1:
        return names
    return [f"{when}: {name}" for when, name in zip((BEFORE, AFTER), names, strict=True)]


def _part(words: Iterator[str], table: Table, runs: Sequence[Measured], unit: SpeedUnit) -> Row:
    names = names_of(runs)
    seed = f"seed {runs[0].run.summary['seed']}"
    lanes = _lanes(runs)
    return {
        "words": list(words),
        "table": table,
        "pictures": [
            picture(
                SPEEDS.format(f"{ALL_LANES.format(lanes)}, {seed}" if lanes > 1 else seed),
                contour_figure(runs, names, unit),
            ),
            picture(QUEUED.format(seed), queue_figure(runs, names)),
        ],
    }


def _lanes(runs: Sequence[Measured]) -> int:
    """The most mainline lanes of runs."""
    return max(measured.run.scenario.mainline.lanes for measured in runs)


def _meaning(lanes: int) -> tuple[str, ...]:
    """What is said below the figures."""
    return (MEANING, SEVERAL_LANES) if lanes > 1 else (MEANING,)


def _asked(measured: Measured, seeds: int) -> str:
    run = measured.run
    over = f"over {run.scenario.simulation.horizon_s / 60.0:g} minutes"
    if run.scenario.arrivals:
        return f"Traffic is a list of {run.vehicles.height} vehicles {over}."
    draws = f"{seeds} draws of arrivals" if seeds > 1 else "one draw of arrivals"
    demand = run.scenario.demand
    peaks = [f"{peak_veh_h(demand, stream):g}" for stream in STREAMS]
    peak = f", {' and '.join(peaks)} where most come" if demand else ""
    return (
        f"Traffic is {run.content['mainline_veh_h']:g} vehicles an hour on the mainline and "
        f"{run.content['ramp_veh_h']:g} on the ramp {over}{peak}, simulated with {draws}."
    )


def _words_of_one(measured: Measured) -> Iterator[str]:
    found, left = measured.figures, measured.run.summary["unserved"]
    yield _asked(measured, 1)
    yield (
        f"With {title_of(measured.run)} vehicles lose {_text('mainline_delay_s', found)} s on the "
        f"mainline and {_text('ramp_delay_s', found)} s on the ramp on average. Together they "
        f"spend {_text('time_spent_h', found)} vehicle hours, {_text('delay_h', found)} of them "
        "as delay."
    )
    yield f"{_breakdown([measured])}; {_unserved(left)}."
    yield (
        f"In its densest 15 minutes the merge works at level of service {measured.letter}. "
        f"{_queues(found)}"
    )
    yield f"Vehicles burn {_text('fuel_l', found)} l of fuel: {_text('co2_kg', found)} kg of CO₂."


def _words(pairs: Pairs, found: Sequence[Change]) -> Iterator[str]:
    by = {change.key: change for change in found}
    names = [title_of(measured.run) for measured in pairs[0]]
    yield _asked(pairs[0][0], len(pairs))
    yield f"Before: {names[0]}. After: {names[1]}. Both meet the same vehicles at the same times."
    yield compared_words(by["time_spent_h"], "All vehicles together spend", "hours")
    for stream in ("mainline", "ramp"):
        if f"{stream}_delay_s" in by:
            yield compared_words(
                by[f"{stream}_delay_s"], f"On the {stream} they lose", "s on average"
            )
    yield _breakdowns(pairs)
    letters = [sorted({m.letter for m in runs}) for runs in zip(*pairs, strict=True)]
    yield (
        "In its densest 15 minutes the merge works at level of service "
        f"{' to '.join(letters[0])} before and {' to '.join(letters[1])} after."
    )
    yield compared_words(by["co2_kg"], "Vehicles emit", "kg of CO₂")
    yield _collisions(by["collisions"])
    if len(pairs) == 1:
        yield ONE_SEED


def compared_words(change: Change, lead: str, unit: str) -> str:
    """Returns a figure before and after in a sentence, and whether the difference is sure."""
    digits = FIGURES[change.key].digits
    before, after = (number(e.mean, digits) for e in (change.before, change.after))
    text = f"{lead} {after} {unit} after, {before} before"
    if before == after:
        return f"{text}: no difference."
    word = "less" if change.change.mean < 0.0 else "more"
    text += f": {number(abs(change.change.mean), digits)} {word}"
    if change.before.mean > 0.0:
        text += f" ({100.0 * abs(change.change.mean) / change.before.mean:.0f} %)"
    if math.isnan(change.change.half_width):
        return f"{text}."
    sure = "this is sure" if change.is_sure else "this may be chance"
    return f"{text}; {sure}."


def _breakdown(runs: Sequence[Measured]) -> str:
    """In how many runs traffic broke down, and when first."""
    times_min = [m.breakdown_min for m in runs if not math.isnan(m.breakdown_min)]
    if not times_min:
        return NO_BREAKDOWN
    when = f"after {min(times_min):g} minutes" + (" at the earliest" if len(runs) > 1 else "")
    many = f" in {len(times_min)} of {len(runs)} draws" if len(runs) > 1 else ""
    return f"Traffic breaks down{many}, {when}"


def _breakdowns(pairs: Pairs) -> str:
    """When traffic broke down before and after."""
    before, after = (_breakdown(runs) for runs in zip(*pairs, strict=True))
    if before == after == NO_BREAKDOWN:
        return "Traffic breaks down neither before nor after."
    return f"{before} before. {after} after."


def _collisions(change: Change) -> str:
    """How many vehicles collided, of all seeds together."""
    before, after = (round(e.mean * e.values) for e in (change.before, change.after))
    if not before and not after:
        return "Nobody collides, before or after."
    return f"Collisions: {before} before, {after} after."


def _unserved(left: int) -> str:
    if not left:
        return "every vehicle gets through"
    return f"{left} vehicles do not get through" if left > 1 else "1 vehicle does not get through"


def _queues(found: dict[str, float | None]) -> str:
    return (
        f"The ramp's queue is {_text('ramp_queue_m', found)} m long at most, and "
        f"{_text('congested_m', found)} m of the mainline are congested."
    )


def _text(key: str, found: dict[str, float | None]) -> str:
    return number(found[key], FIGURES[key].digits)


def _table_of_one(measured: Measured) -> Table:
    rows = [
        (figure.label, number(measured.figures[key], figure.digits))
        for key, figure in FIGURES.items()
        if measured.figures[key] is not None
    ]
    return Table(
        "What came of it",
        ("what", "value"),
        (*rows, (LETTER, measured.letter)),
        _meaning(_lanes([measured])),
    )


def _table(pairs: Pairs, found: Sequence[Change]) -> Table:
    """Figures before and after; with several seeds the difference has its 95 % interval."""
    rows = []
    for change in found:
        figure = FIGURES[change.key]
        texts = [number(e.mean, figure.digits) for e in (change.before, change.after)]
        rows.append((figure.label, *texts, with_interval(change.change, figure.digits)))
    letters = [" to ".join(sorted({m.letter for m in runs})) for runs in zip(*pairs, strict=True)]
    rows.append((LETTER, *letters, "-"))
    seeds, lanes = len(pairs), _lanes([one for pair in pairs for one in pair])
    title = (
        f"Means of {seeds} seeds, with 95 % intervals of the difference"
        if seeds > 1
        else (f"Before and after, seed {pairs[0][0].run.summary['seed']}")
    )
    return Table(title, ("what", BEFORE, AFTER, "difference"), tuple(rows), _meaning(lanes))
