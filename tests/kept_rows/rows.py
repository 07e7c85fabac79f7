"""Makes the rows of the kept runs, and reads and compares them."""

import gzip
import json
from pathlib import Path
from typing import Any

from coramp.errors import CorampError
from coramp.runs.running import execute, failed_row, make_spec
from tests.kept_rows.specs import Kept

PATH = Path(__file__).parent / "rows.json.gz"
WALL_TIMES = ("wall_s", "planning_median_s", "planning_p95_s", "run_id", "coramp_version")
ROUNDING = 1e-9


def row_of(run: Kept) -> dict[str, Any]:
    """Returns the row of a run, or of its failure, without wall times."""
    try:
        spec = make_spec(run.scenario, run.strategy, **run.options)
    except CorampError as error:
        return {"refused": str(error)}
    try:
        row = execute(spec)[1]
    except CorampError as error:
        row = failed_row(spec, str(error), 0.0)
    return {key: value for key, value in row.items() if key not in WALL_TIMES}


def kept_rows() -> dict[str, Any]:
    """Returns what was kept: the commit that made it, and a row a run."""
    return json.loads(gzip.decompress(PATH.read_bytes()))  # type: ignore[no-any-return]


def keep(rows: list[dict[str, Any]], commit: str) -> None:
    """Writes rows and the commit that made them."""
    content = json.dumps({"commit": commit, "rows": rows}, sort_keys=True)
    PATH.write_bytes(gzip.compress(content.encode(), mtime=0))


def differences(before: dict[str, Any], now: dict[str, Any], rounding: float) -> list[str]:
    """Returns the old columns whose values differ by more than rounding, a line each."""
    now = json.loads(json.dumps(now))
    return [
        f"{column}: {old!r} -> {now.get(column)!r}"
        for column, old in sorted(before.items())
        if not _same(old, now.get(column), rounding)
    ]


def _same(old: Any, new: Any, rounding: float) -> bool:
    if old == new:
        return True
    if isinstance(old, float) and isinstance(new, float):
        return (old != old and new != new) or abs(old - new) <= rounding * max(1.0, abs(old))
    return False
