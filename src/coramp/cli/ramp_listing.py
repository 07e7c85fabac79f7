"""The on-ramps of a network as rows of plain data, as a table, and what is to be said of them."""

from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path

from coramp.errors import CorampError
from coramp.networks.graph import Network
from coramp.networks.net_file import FORMAT
from coramp.networks.ramps import Found, OnRamp
from coramp.records.schemas import Row
from coramp.scenarios.of_ramp import reason_against
from coramp.studies.speed_unit import SpeedUnit
from coramp.studies.tables import Table, number

MILLIMETRES = 3
"""Digits of lengths in m: SUMO gives its own to the centimetre."""
MOST_NAMED = 5
"""A note names no more edges than these."""
KEPT = ("on-ramp", "merging", "acceleration lane (m)", "mainline lanes", "coordinated")
"""Columns that a narrow terminal keeps longest."""


def only(found: Found, ramp_id: str, network: Path) -> Found:
    """Returns one on-ramp of a network alone; raises CorampError where there is none of that id."""
    try:
        return Found((found.named(ramp_id),), (), ())
    except CorampError as error:
        raise CorampError(f"{network}: {error}") from error


def ramp_rows(found: Found) -> list[Row]:
    """Returns a row for each on-ramp of a network, in the order of their ids."""
    return [_row(ramp) for ramp in found.ramps]


def _row(ramp: OnRamp) -> Row:
    reason = reason_against(ramp)
    lane_m = ramp.merging.lane_m
    return {
        "id": ramp.ramp_id,
        "coordinated": reason is None,
        "reason": reason,
        "merging": ramp.merging.how,
        "side": ramp.side,
        "left_hand": ramp.is_left_hand,
        "acceleration_lane_m": None if lane_m is None else round(lane_m, MILLIMETRES),
        "ramp_m": round(ramp.ramp_m, MILLIMETRES),
        "mainline_m": round(ramp.mainline_m, MILLIMETRES),
        "downstream_m": round(ramp.downstream.length_m, MILLIMETRES),
        "ramp_lanes": len(ramp.ramp_edge.lanes),
        "mainline_lanes": len(ramp.mainline_edge.lanes),
        "merge_lanes": len(ramp.merge_edge.lanes),
        "ramp_limits_mps": [lane.limit_mps for lane in ramp.ramp_edge.lanes],
        "mainline_limits_mps": [lane.limit_mps for lane in ramp.mainline_edge.lanes],
        "merge_limits_mps": [lane.limit_mps for lane in ramp.merge_edge.lanes],
        "ramp_edges": [edge.edge_id for edge in ramp.ramp.edges],
        "mainline_edges": [edge.edge_id for edge in ramp.mainline.edges],
        "downstream_edges": [edge.edge_id for edge in ramp.downstream.edges],
    }


def listed(network: Path, rows: Sequence[Row]) -> str:
    """Returns in words how many on-ramps a network has."""
    if not rows:
        return f"{network}: no on-ramp; nowhere do a link and a through road join into one edge"
    return f"{network}: {len(rows)} on-ramp{'s' if len(rows) > 1 else ''}"


def ramp_table(title: str, rows: Sequence[Row], unit: SpeedUnit) -> Table:
    """Returns the rows as a table with speed limits in a unit, and the reasons below it."""
    columns = (
        *("on-ramp", "merging", "acceleration lane (m)"),
        *("ramp (m)", "ramp lanes", f"ramp ({unit.name})"),
        *("mainline (m)", "mainline lanes", f"mainline ({unit.name})"),
        "coordinated",
    )
    cells = tuple(
        (
            row["id"],
            row["merging"],
            number(row["acceleration_lane_m"], 1),
            number(row["ramp_m"], 1),
            str(row["ramp_lanes"]),
            _limits(row["ramp_limits_mps"], unit),
            number(row["mainline_m"], 1),
            str(row["mainline_lanes"]),
            _limits(row["mainline_limits_mps"], unit),
            "yes" if row["coordinated"] else "no",
        )
        for row in rows
    )
    notes = tuple(
        f"{row['id']} is not coordinated: {row['reason']}." for row in rows if row["reason"]
    )
    return Table(title, columns, cells, notes, KEPT)


def _limits(limits_mps: Sequence[float], unit: SpeedUnit) -> str:
    """One limit, or those of all lanes, from the outermost on, where they differ."""
    found = [number(unit.of(limit), 1) for limit in limits_mps]
    return found[0] if len(set(found)) == 1 else " / ".join(found)


def notes_on(network: Network, found: Found) -> Iterator[str]:
    """Yields what a user must know of a network: who wrote it, its side, what was left out."""
    if network.version != FORMAT:
        yield _of_another_version(network)
    if network.is_left_hand:
        yield "left-hand traffic; lane 0 is the leftmost"
    for edges, what in (
        (found.links, "links join each other there"),
        (found.equals, "the roads that join there are alike"),
    ):
        if edges:
            named = ", ".join(edges[:MOST_NAMED])
            if len(edges) > MOST_NAMED:
                named += f" and {len(edges) - MOST_NAMED} other edges"
            yield f"no on-ramp at {named}: {what}"


def _of_another_version(network: Network) -> str:
    installed = metadata.version("eclipse-sumo")
    by = f" by {network.written_by}" if network.written_by else ""
    told = f"written{by} in format {network.version}; SUMO {installed} writes {FORMAT}"
    if _parts(network.version) > _parts(FORMAT):
        return f"{told} and may not know all that is in it"
    return f"{told} and reads it"


def _parts(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))
