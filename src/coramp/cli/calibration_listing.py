"""A calibrated population as a table, and as plain data."""

from dataclasses import asdict

from coramp.calibration.calibrate import Calibrated
from coramp.calibration.fit import Fit
from coramp.calibration.models import AXES
from coramp.records.schemas import Row
from coramp.studies.speed_unit import SpeedUnit
from coramp.studies.tables import Table, number

WORDS = {
    "tau_s": "time gap, tau (s)",
    "accel_mps2": "largest acceleration (m/s2)",
    "min_gap_m": "gap at a stand (m)",
    "sigma": "imperfection, sigma",
    "lc_cooperative": "lcCooperative",
    "lc_assertive": "lcAssertive",
}


def calibrated_data(found: Calibrated, name: str) -> Row:
    """Returns a calibrated population and its fit as plain data."""
    return {
        "name": name,
        "drivers": found.drivers.model_dump(mode="json"),
        "free_speed_mps": found.free.mean_mps,
        "fit": None if found.fit is None else asdict(found.fit),
        "notes": list(found.notes),
    }


def calibrated_table(found: Calibrated, model: str, v0_mps: float, unit: SpeedUnit) -> Table:
    """Returns what was fitted and how well, in two columns; speeds in a unit."""
    factor = found.drivers.speed_factor
    assert factor is not None
    rows = [
        (f"desired speed, mean ({unit.name})", number(unit.of(factor.mean * v0_mps), 2)),
        ("its standard deviation (% of it)", number(100.0 * factor.deviation / factor.mean, 1)),
    ]
    if found.fit is not None:
        rows += [
            (WORDS[axis.name], number(getattr(found.drivers, axis.name), 3)) for axis in AXES[model]
        ]
        rows += _fit_rows(found.fit, unit)
    return Table(f"Drivers: {found.drivers.car_following}", ("", ""), tuple(rows))


def _fit_rows(fit: Fit, unit: SpeedUnit) -> list[tuple[str, str]]:
    return [
        ("GEH of 5-minute flows, mean", number(fit.geh, 2)),
        ("GEH below 5 (%)", number(100.0 * fit.good_geh_share, 0)),
        (f"RMSE of 5-minute speeds ({unit.name})", number(unit.of(fit.speed_rmse_mps), 2)),
        ("breakdown (s): measured, simulated", _pair(fit.breakdown_s)),
        ("highest 5-minute flow before (veh/h): the same", _pair(fit.capacity_veh_h)),
        ("runs that broke down", f"{fit.broke_down} of {fit.runs}"),
    ]


def _pair(values: tuple[float | None, float | None]) -> str:
    return ", ".join(number(value, 0) for value in values)
