"""The tables of a scenario file on demand over time, measured demand and detectors."""

from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from coramp.road.streams import STREAMS

MAINLINE, RAMP = STREAMS
Road = Literal["mainline", "ramp"]
NotNegative = Annotated[float, Field(ge=0.0)]
Positive = Annotated[float, Field(gt=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Name = Annotated[str, Field(min_length=1, pattern=r"^[^\s<>&\"',;]+$")]
Lane = Annotated[int, Field(ge=0, le=9)]
Period = Annotated[float, Field(ge=60.0, le=3600.0)]


class Table(BaseModel):
    """Frozen, strict, and without room for keys that nobody reads."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class DemandPart(Table):
    """How many vehicles come by a route from ``begin_s`` to ``end_s``: so many and no others.

    Either ``flow_veh_h`` or ``vehicles`` says how many. They are of one ``type``, or of several by
    their ``shares``; left out, the types have the shares that they have everywhere. ``lane`` is the
    one that they enter on. ``station_m`` is where they pass within that time; left out, it is the
    start of the route. Time 0 is the start of the run.
    """

    route: Road
    begin_s: NotNegative = 0.0
    end_s: Positive
    flow_veh_h: NotNegative | None = None
    vehicles: Annotated[int, Field(ge=0)] | None = None
    type: str | None = None
    shares: dict[str, Share] | None = None
    lane: Lane | None = None
    station_m: float | None = None

    @property
    def count(self) -> float:
        """How many vehicles come; a flow may ask for a fraction of one."""
        if self.vehicles is not None:
            return float(self.vehicles)
        return (self.flow_veh_h or 0.0) * (self.end_s - self.begin_s) / 3600.0


def peak_veh_h(parts: Iterable[DemandPart], route: str) -> float:
    """Returns the highest flow (veh/h) of a route in an interval of its demand."""
    flows: dict[tuple[float, float], float] = {}
    for part in parts:
        if part.route == route:
            interval = part.begin_s, part.end_s
            hours = (part.end_s - part.begin_s) / 3600.0
            flows[interval] = flows.get(interval, 0.0) + part.count / hours
    return max(flows.values(), default=0.0)


class CountsFile(Table):
    """Demand as detectors have counted it.

    ``file`` is read relative to the scenario's file; where ``sha256`` is given it must be that of
    the file. ``mainline`` and ``ramp`` are the detectors whose vehicles come by each. Where one of
    ``[[detector]]`` has the same ``id``, that is where they pass; else it is the start of the road.
    ``downstream`` is a detector behind the merge that must have counted no less. ``begin_s`` and
    ``end_s`` cut a part out of the file, whose begin is the start of the run. ``classes`` says of
    which type vehicles of a class are; left out, of the type of the same name. With ``repair`` what
    does not add up is mended where that is possible.
    """

    file: Annotated[str, Field(min_length=1)]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")] | None = None
    mainline: Name
    ramp: Name
    downstream: Name | None = None
    begin_s: NotNegative | None = None
    end_s: Positive | None = None
    classes: dict[str, str] = Field(default_factory=dict)
    repair: bool = False


class Detector(Table):
    """Loops on every lane of a road at a station, which count in periods of ``period_s``."""

    id: Name
    road: Road
    station_m: float
    period_s: Period = 60.0
