"""What a world tells the coordinator. Step k of the control clock is at ``k * step_s``."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from coramp.vehicles.traits import CAR, Traits


class RequestToEnter(NamedTuple):
    """A vehicle at the start of its zone asks to enter, from ``step`` on, at this speed.

    ``traits`` is what it can do; None for a vehicle that only the common limits bind. ``lane`` is
    that of the mainline, 0 next to the ramp; 0 on the ramp.
    """

    vehicle_id: str
    on_ramp: bool
    step: int
    speed_mps: float
    length_m: float
    vehicle_type: str = CAR
    traits: Traits | None = None
    lane: int = 0


class RequestColumns(NamedTuple):
    """The fields of ``RequestToEnter``, each with one entry a request."""

    vehicle_id: tuple[str, ...]
    on_ramp: tuple[bool, ...]
    step: tuple[int, ...]
    speed_mps: tuple[float, ...]
    length_m: tuple[float, ...]
    vehicle_type: tuple[str, ...]
    traits: tuple[Traits | None, ...]
    lane: tuple[int, ...]


def columns_of(requests: Sequence[RequestToEnter]) -> RequestColumns:
    """Returns the requests column by column."""
    fields = len(RequestToEnter._fields)
    return RequestColumns(*(zip(*requests, strict=True) if requests else [()] * fields))


@dataclass(frozen=True, slots=True)
class Report:
    """A vehicle tells where it is. ``std_m`` is the standard deviation of its station.

    ``measured_s`` is when it was there; a report that is told later than that has been carried on
    from then. ``accel_mps2`` is what it drives with until its next such report, None in the reports
    of once a second.
    """

    vehicle_id: str
    time_s: float
    station_m: float
    speed_mps: float
    std_m: float = 0.0
    accel_mps2: float | None = None
    measured_s: float | None = None


@dataclass(frozen=True, slots=True)
class Acknowledgement:
    """A vehicle has the command that was given at ``commanded_s``.

    A world with a lossy channel would send these to ``coordination.service``. The worlds of coramp
    create none, since no command is lost: ``messages.log`` writes the row after each entry and
    command itself.
    """

    vehicle_id: str
    time_s: float
    commanded_s: float


@dataclass(frozen=True, slots=True)
class DetectorReading:
    """What the road's loops tell of the time since the last reading (``strategies.base``)."""

    time_s: float
    mainline_occupancy: float
    queue_occupancy: float
    passed_veh: int


Event = RequestToEnter | Report | Acknowledgement | DetectorReading
