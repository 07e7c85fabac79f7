"""Loops in the formats of SUMO: induction loops' output, and counts for its routers.

- the definition of the loops, which SUMO itself takes as an additional file;
- their output as SUMO writes it (https://sumo.dlr.de/docs/Simulation/Output/Induction_Loops_Detectors_(E1).html);
- the counts that ``flowrouter.py`` and ``dfrouter`` take
  (https://sumo.dlr.de/docs/Demand/dfrouter.html): minutes, vehicles, km/h.
"""

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import polars as pl

from coramp.agency.detectors import Detector
from coramp.records.schemas import Row

HEADER = "Detector;Time;qPKW;qLKW;vPKW;vLKW"
NOBODY = "-1.00"


def definition_xml(detectors: Sequence[Detector], period_s: float, output: str) -> str:
    """Returns the loops as SUMO takes them; they write ``output`` once a period."""
    lines = [
        f"    <inductionLoop id={quoteattr(d.name)} lane={quoteattr(d.lane)} "
        f'pos="{d.position_m:.2f}" period="{period_s:g}" file={quoteattr(output)}/>'
        for d in detectors
    ]
    return "\n".join(["<additional>", *lines, "</additional>", ""])


def router_xml(detectors: Sequence[Detector]) -> str:
    """Returns the loops that all vehicles of a road pass, as ``flowrouter.py`` takes them."""
    lines = [
        f"    <detectorDefinition id={quoteattr(d.name)} lane={quoteattr(d.lane)} "
        f'pos="{d.position_m:.2f}" type="{d.kind}"/>'
        for d in detectors
        if d.kind
    ]
    return "\n".join(["<detectors>", *lines, "</detectors>", ""])


def output_xml(table: pl.DataFrame) -> str:
    """Returns the rows of ``detectors_table`` as SUMO's induction loops write them."""
    ordered = table.sort("from_s", maintain_order=True)
    lines = [_interval(row) for row in ordered.iter_rows(named=True)]
    return "\n".join(["<detector>", *lines, "</detector>", ""])


def _interval(row: Row) -> str:
    flow_veh_h = row["passed"] * 3600.0 / (row["to_s"] - row["from_s"])
    return (
        f'    <interval begin="{row["from_s"]:.2f}" end="{row["to_s"]:.2f}" '
        f'id={quoteattr(row["detector"])} nVehContrib="{row["passed"]}" '
        f'flow="{flow_veh_h:.2f}" occupancy="{row["occupancy_percent"]:.2f}" '
        f'speed="{_known(row["mean_speed_mps"])}" '
        f'harmonicMeanSpeed="{_known(row["harmonic_speed_mps"])}" '
        f'length="{_known(row["mean_length_m"])}" nVehEntered="{row["vehicles"]}"/>'
    )


def _known(value: float | None) -> str:
    return NOBODY if value is None else f"{value:.2f}"


def router_csv(table: pl.DataFrame) -> str:
    """Returns the rows of ``detectors_table`` as ``flowrouter.py`` and ``dfrouter`` read them.

    A row has the minute at which its interval begins, cars, trucks, and their mean speeds in km/h.
    """
    lines = [HEADER]
    for row in table.sort("from_s", maintain_order=True).iter_rows(named=True):
        speeds = (row["car_speed_mps"] or 0.0, row["truck_speed_mps"] or 0.0)
        lines.append(
            f"{row['detector']};{row['from_s'] / 60.0:g};{row['vehicles'] - row['trucks']};"
            f"{row['trucks']};" + ";".join(f"{speed_mps * 3.6:.2f}" for speed_mps in speeds)
        )
    return "\n".join([*lines, ""])
