"""The tables of a world that is not perfect: what is late, lost, wrong, slow or careless.

Each is off where it is left out. They act on automated vehicles among drivers, in SUMO.
"""

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from coramp.equations.conflict_risk import GRAVITY_MPS2

Part = Annotated[float, Field(ge=0.0, le=1.0)]
Metres = Annotated[float, Field(ge=0.0, le=1000.0)]
Seconds = Annotated[float, Field(ge=0.0, le=600.0)]
PerHour = Annotated[float, Field(ge=0.0, le=3600.0)]


class Section(BaseModel):
    """Frozen, strict, and without room for keys that nobody reads."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @property
    def is_perfect(self) -> bool:
        """Whether nothing of this table is set."""
        return self == type(self)()


class World(Section):
    """A set of faults by name; tables beside it replace single keys."""

    preset: Literal["mild", "hard", "rtk-5g", "gnss-its-g5", "urban-canyon", "winter"] | None = None


class Positioning(Section):
    """How wrong reported stations are.

    ``bias_m`` is every vehicle's, signed. ``noise_m`` is the standard deviation of a Gauss-Markov
    error with ``correlation_s``. While a vehicle has an outage, ``outages_per_h`` of ``outage_s``
    on average, its error grows by ``outage_drift_mps``.
    """

    bias_m: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    noise_m: Metres = 0.0
    correlation_s: Annotated[float, Field(gt=0.0, le=600.0)] = 10.0
    speed_noise_mps: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0
    outages_per_h: PerHour = 0.0
    outage_s: Seconds = 5.0
    outage_drift_mps: Annotated[float, Field(ge=0.0, le=20.0)] = 0.5


class Clock(Section):
    """How wrong the time stamps of reports are.

    ``offset_s`` is the standard deviation of each vehicle's own offset, ``drift_ppm`` that of its
    drift (s in a million). At ``step_at_s`` all clocks of vehicles jump by ``step_s``.
    """

    offset_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    drift_ppm: Annotated[float, Field(ge=0.0, le=10000.0)] = 0.0
    step_at_s: Seconds = 0.0
    step_s: Annotated[float, Field(ge=-10.0, le=10.0)] = 0.0


class Link(Section):
    """How messages travel: late by ``delay_s`` on average, and some never arrive.

    Latency is drawn from a gamma distribution of ``delay_shape``, or is the same for all messages
    without one. ``loss`` is the share that is lost, each for itself, or with ``burst_s`` in bad
    phases of that mean length (Gilbert-Elliott). ``duplicates`` is the share that comes twice.
    """

    delay_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    delay_shape: Annotated[float, Field(gt=0.0, le=100.0)] | None = None
    loss: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.0
    burst_s: Annotated[float, Field(gt=0.0, le=60.0)] | None = None
    duplicates: Part = 0.0


class ReportLink(Link):
    """Reports of vehicles, one each ``period_s``, or before each decision without it."""

    period_s: Annotated[float, Field(gt=0.0, le=10.0)] | None = None
    stale_s: Annotated[float, Field(gt=0.0, le=60.0)] = 3.0


class CommandLink(Link):
    """Commands to vehicles, which count for ``valid_s`` from when they were given."""

    valid_s: Annotated[float, Field(gt=0.0, le=60.0)] = 1.5


class Actuators(Section):
    """How automated vehicles follow an acceleration: after ``dead_time_s``, with a lag."""

    dead_time_s: Annotated[float, Field(ge=0.0, le=2.0)] = 0.0
    lag_s: Annotated[float, Field(ge=0.0, le=2.0)] = 0.0


class RoadSurface(Section):
    """What the road lets tyres do: ``adhesion`` as it is, ``assumed_adhesion`` as vehicles take it.

    Both are shares of the weight. Nobody brakes harder than adhesion times g; automated vehicles
    reckon with no harder braking than assumed adhesion times g, their own and others'.
    """

    adhesion: Annotated[float, Field(gt=0.0, le=1.2)] | None = None
    assumed_adhesion: Annotated[float, Field(gt=0.0, le=1.2)] | None = None

    @property
    def most_braking_mps2(self) -> float:
        """What tyres can do (m/s2, positive), infinity for no limit."""
        return math.inf if self.adhesion is None else self.adhesion * GRAVITY_MPS2

    @property
    def assumed_braking_mps2(self) -> float:
        """What automated vehicles take tyres to do (m/s2, positive), infinity for no limit."""
        return math.inf if self.assumed_adhesion is None else self.assumed_adhesion * GRAVITY_MPS2


class Behaviour(Section):
    """Who does not do what others reckon with.

    Of drivers ``never_yields_share`` never yield, ``inattentive_share`` look up only once in
    ``inattentive_s``, and one of them brakes for nothing, at ``brake_mps2`` for ``brake_s``,
    ``brakes_for_nothing_per_h``. Of automated vehicles ``silent_share`` fall silent at some time,
    ``disobeys_share`` ignore what they are told, ``lies_share`` report a station that is wrong by
    ``lie_m``.
    """

    never_yields_share: Part = 0.0
    inattentive_share: Part = 0.0
    inattentive_s: Annotated[float, Field(gt=0.0, le=5.0)] = 1.0
    brakes_for_nothing_per_h: PerHour = 0.0
    brake_mps2: Annotated[float, Field(gt=0.0, le=9.0)] = 8.0
    brake_s: Seconds = 2.0
    silent_share: Part = 0.0
    disobeys_share: Part = 0.0
    lies_share: Part = 0.0
    lie_m: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 20.0


class Incidents(Section):
    """A vehicle breaks down: the next one to reach a station after a time stops there.

    ``place`` is the mainline or the ramp with its acceleration lane. It brakes softly enough to
    come to a stand at the station, changes no lane, and drives on after ``lasts_s``.
    """

    breakdown_s: Annotated[float, Field(ge=0.0, le=86400.0)] | None = None
    place: Literal["mainline", "ramp"] = "mainline"
    station_m: Annotated[float, Field(ge=-20000.0, le=20000.0)] = -100.0
    lasts_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 60.0


TABLES: dict[str, type[Section]] = {
    "world": World,
    "positioning": Positioning,
    "clock": Clock,
    "reports": ReportLink,
    "commands": CommandLink,
    "actuators": Actuators,
    "road": RoadSurface,
    "behaviour": Behaviour,
    "incidents": Incidents,
}
"""The tables of a world that is not perfect, by their names in a scenario."""

PRESETS: dict[str, dict[str, dict[str, Any]]] = {
    "mild": {
        "positioning": {"noise_m": 0.5},
        "reports": {"delay_s": 0.2, "loss": 0.1},
        "commands": {"delay_s": 0.1, "loss": 0.1},
        "actuators": {"lag_s": 0.3},
    },
    "hard": {
        "positioning": {"noise_m": 1.0},
        "reports": {"delay_s": 0.5, "loss": 0.3},
        "commands": {"delay_s": 0.2, "loss": 0.3},
        "actuators": {"lag_s": 0.5},
    },
    "rtk-5g": {
        "positioning": {"noise_m": 0.05, "correlation_s": 30.0},
        "clock": {"offset_s": 1e-6},
        "reports": {"delay_s": 0.02, "delay_shape": 4.0, "loss": 0.001},
        "commands": {"delay_s": 0.02, "delay_shape": 4.0, "loss": 0.001},
        "actuators": {"lag_s": 0.2},
    },
    "gnss-its-g5": {
        "positioning": {"noise_m": 1.5, "correlation_s": 60.0, "speed_noise_mps": 0.1},
        "clock": {"offset_s": 0.001},
        "reports": {"period_s": 0.2, "delay_s": 0.05, "delay_shape": 2.0, "loss": 0.05},
        "commands": {"delay_s": 0.05, "delay_shape": 2.0, "loss": 0.05},
        "actuators": {"lag_s": 0.3},
    },
    "urban-canyon": {
        "positioning": {
            "noise_m": 5.0,
            "correlation_s": 60.0,
            "speed_noise_mps": 0.3,
            "outages_per_h": 12.0,
            "outage_s": 10.0,
        },
        "clock": {"offset_s": 0.001},
        "reports": {"delay_s": 0.1, "delay_shape": 2.0, "loss": 0.3, "burst_s": 1.0},
        "commands": {"delay_s": 0.1, "delay_shape": 2.0, "loss": 0.3, "burst_s": 1.0},
        "actuators": {"lag_s": 0.3},
    },
    "winter": {
        "positioning": {"noise_m": 1.5, "correlation_s": 60.0},
        "reports": {"delay_s": 0.05, "delay_shape": 2.0, "loss": 0.1},
        "commands": {"delay_s": 0.05, "delay_shape": 2.0, "loss": 0.1},
        "actuators": {"lag_s": 0.4},
        "road": {"adhesion": 0.3, "assumed_adhesion": 0.3},
    },
}
"""Faults that come together.

``mild`` and ``hard`` are coramp's own. ``rtk-5g``: RTK positions within 5 cm, and latency of 5G
private networks (3GPP TS 22.186 asks for 3 to 100 ms). ``gnss-its-g5``: single-frequency GNSS at
1.5 m (1 sigma), and cooperative awareness messages over ITS-G5 (ETSI EN 302 637-2: 1 to 10 Hz; here
5 Hz, latency within 100 ms). ``urban-canyon``: errors of 5 m and outages between buildings, losses
in bursts. ``winter``: adhesion on packed snow of about 0.3 (dry asphalt: 0.8 to 0.9), which
automated vehicles know.
"""


def with_preset(data: dict[str, Any]) -> dict[str, Any]:
    """Returns scenario data in which keys that a preset sets are filled in where they are not."""
    chosen = data.get("world", {})
    preset = chosen.get("preset") if isinstance(chosen, dict) else None
    if not isinstance(preset, str) or preset not in PRESETS:
        return data
    filled = dict(data)
    for table, values in PRESETS[preset].items():
        own = data.get(table, {})
        filled[table] = {**values, **own} if isinstance(own, dict) else own
    return filled
