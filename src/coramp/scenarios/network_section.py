"""The table ``[network]``: a merge site in a SUMO network of the user's own, by file and hash."""

import hashlib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from coramp.errors import CorampError
from coramp.networks.net_file import read_network
from coramp.networks.ramps import OnRamp, on_ramps
from coramp.scenarios.of_ramp import measures_of, reason_against

if TYPE_CHECKING:
    from coramp.scenarios.model import Scenario

SAME_M = 0.01
"""Lengths in a scenario are those of its network to the centimetre."""


class NetworkSection(BaseModel):
    """Where the road lies: the on-ramp ``ramp`` of the SUMO network in ``file``.

    ``sha256`` is that of the file: another file is another road.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    file: Annotated[str, Field(min_length=1)]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    ramp: Annotated[str, Field(min_length=1)]


def with_path(data: dict[str, Any], label: str) -> dict[str, Any]:
    """Returns a scenario's content with the path of its network counted from the file's folder."""
    network = data.get("network")
    if not isinstance(network, dict) or not isinstance(network.get("file"), str):
        return data
    path = str((Path(label).parent / network["file"]).absolute())
    return {**data, "network": {**network, "file": path}}


def sha256_of(path: Path) -> str:
    """Returns the hash of a file; raises CorampError where it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise CorampError(
            f"{path}: cannot be read: {error.strerror}; allowed is a SUMO network, .net.xml or "
            ".net.xml.gz"
        ) from error


def changed_line(path: Path, found: str) -> str:
    """Returns what to tell where a network is not that of its scenario's hash."""
    return (
        f"{path} has changed: it is {found} now; allowed is the file of that hash, or a new "
        "scenario by coramp new-scenario"
    )


def site_of(section: NetworkSection) -> OnRamp:
    """Returns the merge site that a section names.

    Raises CorampError where the file is not there or has changed, and where it has no such on-ramp.
    """
    path = Path(section.file)
    found = sha256_of(path)
    if found != section.sha256:
        raise CorampError(f"network.sha256: {changed_line(path, found)}")
    return _site(path, found, section.ramp)


@cache
def _site(path: Path, _sha256: str, ramp_id: str) -> OnRamp:
    """Reads a network once in this process, as long as the file stays as it is."""
    try:
        return on_ramps(read_network(path)).named(ramp_id)
    except CorampError as error:
        told = str(error)
        raise CorampError(f"network.ramp: {told}" if str(path) not in told else told) from error


def check_network(scenario: "Scenario", label: str) -> None:
    """Raises CorampError where a scenario's network is not there, or not the road that it says."""
    if scenario.network is None:
        return
    try:
        site = site_of(scenario.network)
    except CorampError as error:
        raise CorampError(f"{label}: {error}") from error
    if reason := reason_against(site):
        raise CorampError(f"{label}: network.ramp: {site.ramp_id} cannot be run: {reason}")
    for key, found in measures_of(site).items():
        table, name = key.split(".")
        given = getattr(getattr(scenario, table), name)
        if abs(given - found) > SAME_M:
            raise CorampError(
                f"{label}: {key}: {given:g} is not what {scenario.network.ramp} has; "
                f"allowed is {found:g}"
            )
