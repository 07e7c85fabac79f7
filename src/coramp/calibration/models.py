"""What of a population of drivers is fitted, by car-following model, and within which ranges."""

from typing import Literal

from coramp.calibration.search import Axis
from coramp.errors import CorampError
from coramp.scenarios.sections import DriverPopulation, SpeedFactor

COMMON = (
    Axis("tau_s", 0.5, 2.0),
    Axis("accel_mps2", 0.8, 3.5, usual=1.8),
    Axis("min_gap_m", 1.0, 4.0, usual=2.5),
    Axis("lc_cooperative", 0.3, 1.0, usual=1.0),
    Axis("lc_assertive", 0.6, 2.5, usual=1.0),
)
AXES = {
    "krauss": (*COMMON, Axis("sigma", 0.1, 0.9, usual=0.5)),
    "idm": COMMON,
    "eidm": COMMON,
}
"""Usual values are SUMO's: what detectors do not show stays near them. But its
acceleration of 2.6 m/s2 is more than drivers use; 1.8 is between that and ``credible``'s."""
SUMO_NAMES: dict[str, Literal["Krauss", "IDM", "EIDM"]] = {
    "krauss": "Krauss",
    "idm": "IDM",
    "eidm": "EIDM",
}
CUT_OFF = 2.0
"""How many standard deviations from the mean speed factors are cut off."""
LEAST_DEVIATION = 0.002


def model_checked(model: str) -> str:
    """Returns the name of a model in small letters; raises CorampError if there is none such."""
    name = model.lower()
    if name not in AXES:
        raise CorampError(f"--model: there is no {model!r}; allowed are {', '.join(AXES)}")
    return name


def speed_factor(mean: float, deviation: float) -> SpeedFactor:
    """Returns a distribution of wishes over the common speed, cut off to both sides alike."""
    deviation = max(LEAST_DEVIATION, deviation)
    aside = min(CUT_OFF * deviation, mean - 0.05, 2.0 - mean)
    numbers = {"mean": mean, "deviation": deviation, "low": mean - aside, "high": mean + aside}
    return SpeedFactor(**{name: round(value, 4) for name, value in numbers.items()})


def usual_population(model: str, factor: SpeedFactor) -> DriverPopulation:
    """Returns SUMO's own drivers of a model, who wish their share of the common speed."""
    return DriverPopulation(wish="free-flow", speed_factor=factor, car_following=SUMO_NAMES[model])
