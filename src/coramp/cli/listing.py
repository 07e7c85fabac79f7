"""What comes with coramp, by kind."""

from pathlib import Path

from coramp.errors import CorampError
from coramp.scenarios.as_taken import as_toml
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.snapshots import load_snapshot
from coramp.scenarios.toml_files import builtin_names, builtin_text
from coramp.studies.definition import load_study


def listing() -> dict[str, dict[str, str]]:
    """Returns names and descriptions of the built-in scenarios, snapshots and studies."""
    return {
        "scenarios": {n: load_scenario(n).description for n in builtin_names("scenarios")},
        "snapshots (for coramp plan)": {
            n: load_snapshot(n).description for n in builtin_names("snapshots")
        },
        "studies": {n: load_study(n).description for n in builtin_names("studies")},
    }


def printed(name: str) -> str:
    """Returns a built-in file as it is, or a scenario of one's own with all that is chosen for it.

    Raises CorampError where there is neither, and for a file that is no valid scenario.
    """
    try:
        return builtin_text(name)
    except CorampError:
        if not Path(name).is_file():
            raise
    return as_toml(name)
