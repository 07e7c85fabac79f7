"""Reported positions and times that are wrong."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.scenarios.world_sections import Clock, Positioning

SECONDS_AN_HOUR = 3600.0
PPM = 1e-6


@dataclass
class WrongPositions:
    """The error of each vehicle's position: bias, Gauss-Markov noise, drift in an outage.

    e(t + d) = e(t) exp(-d / T) + sigma sqrt(1 - exp(-2 d / T)) n, n standard normal.
    ``outages`` are those that have begun: when (s), and which vehicle's.
    ``random_of`` returns random numbers by a fault's name. Each time is drawn for all vehicles, so
    that neither another fault nor who is on the road changes a vehicle's draws.
    """

    section: Positioning
    vehicles: int
    random_of: Callable[[str], np.random.Generator]
    outages: list[tuple[float, int]] = field(default_factory=list)
    _noise: np.random.Generator = field(init=False)
    _speed_noise: np.random.Generator = field(init=False)
    _outages: np.random.Generator = field(init=False)
    _error_m: FloatArray = field(init=False)
    _drift_m: FloatArray = field(init=False)
    _out_until_s: FloatArray = field(init=False)
    _asked_s: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """The first errors are drawn as all others are distributed."""
        self._noise, self._outages = self.random_of("noise"), self.random_of("outages")
        self._speed_noise = self.random_of("speed noise")
        self._error_m = self.section.noise_m * self._noise.standard_normal(self.vehicles)
        self._drift_m = np.zeros(self.vehicles)
        self._out_until_s, self._asked_s = np.zeros(self.vehicles), np.full(self.vehicles, np.nan)

    def error_m(self, number: IntArray, now_s: float) -> FloatArray:
        """Returns the error (m) of the position of each of these vehicles now."""
        section = self.section
        before_s = self._asked_s[number]
        since_s = np.where(np.isnan(before_s), 0.0, now_s - before_s)
        self._asked_s[number] = now_s
        keeps = np.exp(-since_s / section.correlation_s)
        fresh = section.noise_m * np.sqrt(1.0 - keeps**2)
        noise = self._noise.standard_normal(self.vehicles)[number]
        self._error_m[number] = self._error_m[number] * keeps + fresh * noise
        if section.outages_per_h > 0.0:
            self._with_outages(number, since_s, now_s)
        return np.asarray(section.bias_m + self._error_m[number] + self._drift_m[number])

    def speed_error_mps(self, number: IntArray) -> FloatArray:
        """Returns errors (m/s) of reported speeds, independent of one another."""
        errors = self._speed_noise.standard_normal(self.vehicles)[number]
        return np.asarray(self.section.speed_noise_mps * errors)

    def _with_outages(self, number: IntArray, since_s: FloatArray, now_s: float) -> None:
        chance = -np.expm1(-self.section.outages_per_h / SECONDS_AN_HOUR * since_s)
        begins = self._outages.random(self.vehicles)[number] < chance
        lasts_s = self._outages.exponential(self.section.outage_s, self.vehicles)[number]
        begins &= self._out_until_s[number] <= now_s  # one that is out does not go out again
        self.outages += [(now_s, n) for n in number[begins].tolist()]
        until_s = np.where(begins, now_s + lasts_s, self._out_until_s[number])
        out: BoolArray = until_s > now_s
        drift_m = self._drift_m[number] + self.section.outage_drift_mps * since_s
        self._out_until_s[number] = until_s
        self._drift_m[number] = np.where(out, drift_m, 0.0)


@dataclass
class WrongClocks:
    """The error of each vehicle's clock: an offset, a drift, a jump at one time.

    ``random_of`` returns random numbers by a fault's name.
    """

    section: Clock
    vehicles: int
    random_of: Callable[[str], np.random.Generator]
    _offset_s: FloatArray = field(init=False)
    _drift: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Each vehicle has an offset and a drift of its own."""
        offsets = self.random_of("offset").standard_normal(self.vehicles)
        drifts = self.random_of("drift").standard_normal(self.vehicles)
        self._offset_s = self.section.offset_s * offsets
        self._drift = self.section.drift_ppm * PPM * drifts

    def error_s(self, number: IntArray, now_s: float) -> FloatArray:
        """Returns by how much (s) the clocks of these vehicles are fast."""
        jumped = self.section.step_s if now_s >= self.section.step_at_s else 0.0
        return np.asarray(self._offset_s[number] + self._drift[number] * now_s + jumped)
