"""Fuel and CO2 by type of vehicle.

A litre of petrol gives 2.348 kg of CO2, one of diesel 2.689 kg: 8,887 and 10,180 g a gallon (U.S.
EPA, Greenhouse Gas Emissions from a Typical Passenger Vehicle, EPA-420-F-18-008, March 2018). Cars
burn petrol, heavy-duty vehicles diesel, as in the models of their fuel.
"""

import numpy as np
import polars as pl

from coramp.agency.level_of_service import is_heavy
from coramp.agency.motion import Motion
from coramp.agency.schemas import EMISSIONS
from coramp.records.schemas import Row
from coramp.road.streams import STREAMS

L_PER_GALLON = 3.785411784
PETROL_KG_L, DIESEL_KG_L = 8.887 / L_PER_GALLON, 10.180 / L_PER_GALLON


def emissions_table(motion: Motion) -> pl.DataFrame:
    """Returns one row a type, stream and kind of driving, with the columns of ``EMISSIONS``."""
    way_m = np.bincount(motion.vehicle, motion.way_m, minlength=len(motion))
    co2_kg = motion.fuel_l * np.where(is_heavy(motion), DIESEL_KG_L, PETROL_KG_L)
    kinds = np.array(motion.vehicle_type, object)
    rows: list[Row] = []
    for kind in sorted(set(motion.vehicle_type)):
        for on_ramp in (False, True):
            for automated in (False, True):
                own = (
                    (kinds == kind) & (motion.on_ramp == on_ramp) & (motion.automated == automated)
                )
                if not own.any():
                    continue
                rows.append(
                    {
                        "vehicle_type": kind,
                        "stream": STREAMS[on_ramp],
                        "automated": automated,
                        "vehicles": int(own.sum()),
                        "vehicle_km": float(way_m[own].sum()) / 1000.0,
                        "fuel_l": float(motion.fuel_l[own].sum()),
                        "co2_kg": float(co2_kg[own].sum()),
                    }
                )
    return pl.DataFrame(rows, schema=EMISSIONS)
