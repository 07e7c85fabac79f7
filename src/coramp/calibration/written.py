"""A calibrated population as a file: its table, and where it comes from."""

import hashlib
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import tomli_w

from coramp.calibration.calibrate import Calibrated
from coramp.calibration.moments import OBJECTIVE
from coramp.errors import CorampError
from coramp.records.files import write_text
from coramp.scenarios.population_files import ENDING

HEAD = "# Drivers fitted to detectors by coramp calibrate; use them by coramp run --drivers FILE.\n"


@dataclass(frozen=True)
class Provenance:
    """Where a population comes from; ``date`` is as the user gave it, empty for none."""

    counts: str
    counts_sha256: str
    scenario: str
    model: str
    runs: int
    seeds: int
    date: str

    @property
    def in_words(self) -> str:
        """Returns it in one line, which goes with the population wherever it is used."""
        when = f" on {self.date}" if self.date else ""
        return (
            f"calibrated{when} to {self.counts} (sha256 {self.counts_sha256[:12]}) on "
            f"{self.scenario}"
        )


def sha256_of(path: Path) -> str:
    """Returns the SHA-256 of a file; raises CorampError where it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise CorampError(f"{path}: cannot be read: {error.strerror}") from error


def checked_out(out: Path) -> Path:
    """Returns a file to write drivers into; its name without the ending will be theirs.

    Raises CorampError for one that could not be given to ``--drivers``, or has no folder.
    """
    if out.suffix != ENDING or not out.stem:
        raise CorampError(f"--out: {out}: does not end in .toml; allowed is such as drivers.toml")
    if not out.parent.is_dir():
        raise CorampError(f"--out: {out.parent}: no such folder; allowed is one that is there")
    return out


def population_text(found: Calibrated, name: str, origin: Provenance) -> str:
    """Returns the TOML file of a population: ``[drivers.NAME]`` and ``[provenance]``."""
    own = found.drivers.model_dump(mode="json", exclude_none=True)
    provenance: dict[str, Any] = asdict(origin)
    provenance["objective"] = OBJECTIVE
    provenance["coramp"], provenance["sumo"] = map(metadata.version, ("coramp", "eclipse-sumo"))
    provenance["free_speed_mps"] = round(found.free.mean_mps, 3)
    provenance["notes"] = list(found.notes)
    if found.fit is not None:
        provenance["fit"] = {
            name: _rounded(value)
            for name, value in asdict(found.fit).items()
            if not isinstance(value, tuple)
        }
        for key in ("breakdown_s", "capacity_veh_h"):
            measured, simulated = getattr(found.fit, key)
            if measured is not None:
                provenance["fit"][f"measured_{key}"] = _rounded(measured)
            if simulated is not None:
                provenance["fit"][f"simulated_{key}"] = _rounded(simulated)
    table = {**own, "origin": origin.in_words}
    return HEAD + tomli_w.dumps({"drivers": {name: table}, "provenance": provenance})


def write_population(found: Calibrated, out: Path, origin: Provenance) -> None:
    """Writes a population; what was there under that name is replaced as a whole."""
    write_text(out, population_text(found, checked_out(out).stem, origin))


def _rounded(value: float) -> float | int:
    return value if isinstance(value, int) else round(value, 4)
