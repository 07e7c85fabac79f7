"""The run of a corridor, read back from its folder."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from coramp.errors import CorampError
from coramp.records.corridor_outcome import CORRIDOR_FILES, METERS_FILE, SITES, TOTALS
from coramp.records.files import read_json
from coramp.records.run_folder import CORRIDOR, MARK, SUMO, SUMO_NETWORK, check_version
from coramp.records.schemas import Row, Schema
from coramp.records.stored_checks import checked_frame
from coramp.scenarios.corridors import TABLE, Corridor, corridor_of

POSITIONS = "fcd.parquet"
KEYS = ("vehicle_id", "step")
PLACES: Schema = {
    "vehicle_id": pl.String,
    "step": pl.Int64,
    "type": pl.String,
    "lane": pl.String,
    "pos": pl.Float64,
    "x": pl.Float64,
    "y": pl.Float64,
    "angle": pl.Float64,
    "speed": pl.Float64,
}
"""What positions tell, by SUMO's names: of lane and position on it (m), of x and y (m)."""
NEEDED = (
    "scenario", "strategy", "drivers", "seed", "specification", "versions", "summary", "sites",
)  # fmt: skip


@dataclass(frozen=True)
class CorridorRecords:
    """What the folder of a corridor's run holds: ``run.json``, and the tables by their names."""

    folder: Path
    content: Row
    frames: Mapping[str, pl.DataFrame]

    @property
    def summary(self) -> Row:
        """The corridor's totals."""
        return dict(self.content["summary"])

    @property
    def horizon_s(self) -> float:
        """How long vehicles arrive."""
        return float(self.content["specification"]["simulation"]["horizon_s"])

    @property
    def step_s(self) -> float:
        """SUMO's step."""
        return float(self.content["specification"]["control"]["step_s"])

    @property
    def has_positions(self) -> bool:
        """Whether SUMO's positions were kept."""
        return (self.folder / SUMO / POSITIONS).exists()

    def positions(self, every: int = 1) -> pl.LazyFrame:
        """Returns where vehicles were at each step of SUMO's, or at each so many, by time.

        Columns are those of ``PLACES``. Raises CorampError where positions were not kept.
        """
        if not self.has_positions:
            raise CorampError(
                f"{self.folder}: holds no positions; run again with --keep-sumo in another folder"
            )
        written = pl.scan_parquet(self.folder / SUMO / POSITIONS)
        if "vehicle_id" not in written.collect_schema():  # nobody ever drove
            return pl.LazyFrame(schema=PLACES)
        step = (pl.col("timestep_time") / self.step_s).round().cast(pl.Int64)
        return (
            written.drop_nulls("vehicle_id")
            .filter(step % every == 0)
            .select(
                "vehicle_id",
                step=step,
                **{name: pl.col(f"vehicle_{name}") for name in PLACES if name not in KEYS},
            )
        )

    def corridor(self) -> Corridor:
        """Returns the corridor, by the network that was kept beside SUMO's positions.

        Raises CorampError where no network was kept, and where it is another by now.
        """
        copies = (self.folder / SUMO / f"{SUMO_NETWORK}{ending}" for ending in ("", ".gz"))
        network = next((path for path in copies if path.exists()), None)
        if network is None:
            raise CorampError(
                f"{self.folder}: holds no network; run again with --keep-sumo in another folder"
            )
        specification = self.content["specification"]
        section = {**specification[TABLE], "file": str(network.absolute())}
        return corridor_of({**specification, TABLE: section}, str(self.folder / MARK))


def holds_corridor(folder: Path) -> bool:
    """Returns whether a folder holds the run of a corridor."""
    try:
        content = read_json(folder / MARK)
    except CorampError:
        return False
    return isinstance(content, dict) and content.get("kind") == CORRIDOR


def read_corridor(folder: Path) -> CorridorRecords:
    """Returns the run of a corridor; raises CorampError where it cannot be read."""
    mark = folder / MARK
    content = read_json(mark)
    check_version(folder, content)
    missing = [key for key in NEEDED if key not in content]
    missing += [f"summary.{key}" for key in TOTALS if key not in content.get("summary", ())]
    if missing:
        raise CorampError(f"{mark}: {missing[0]}: is missing; run again to write it anew")
    frames = {}
    for name, schema in CORRIDOR_FILES.items():
        path = folder / f"{name}.parquet"
        if name == METERS_FILE and not path.exists():  # no ramp was metered
            continue
        try:
            frames[name] = checked_frame(path, pl.read_parquet(path), schema)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise CorampError(f"{path}: cannot be read: {error}; run again") from error
    if any(set(SITES) - row.keys() for row in content["sites"]):
        raise CorampError(f"{mark}: sites: lack a figure; run again to write it anew")
    return CorridorRecords(folder, content, frames)
