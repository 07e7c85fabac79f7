"""What comes with coramp, by kind."""

from coramp.scenarios.loading import load_scenario
from coramp.scenarios.snapshots import load_snapshot
from coramp.scenarios.toml_files import builtin_names
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
