"""All tables that agencies read of a run."""

import polars as pl

from coramp.agency.contour import contour_table
from coramp.agency.detectors import detectors_table
from coramp.agency.emissions import emissions_table
from coramp.agency.intervals import intervals_table
from coramp.agency.level_of_service import levels_table
from coramp.agency.motion import Motion
from coramp.agency.queues import queues_table
from coramp.agency.travel_times import travel_times_table


def agency_tables(motion: Motion) -> dict[str, pl.DataFrame]:
    """Returns the tables of a run by name, as ``schemas.AGENCY`` lists them."""
    return {
        "intervals": intervals_table(motion),
        "queues": queues_table(motion),
        "contour": contour_table(motion),
        "levels_of_service": levels_table(motion),
        "emissions": emissions_table(motion),
        "travel_times": travel_times_table(motion),
        "detectors": detectors_table(motion),
    }
