"""``python -m tests.kept_rows``: compares every kept row with what the code gives now.

``--keep`` writes the rows of this commit instead. Exit code 1 if a row differs by more than
rounding.
"""

import os
import subprocess
import sys

from joblib import Parallel, delayed

from tests.kept_rows.rows import ROUNDING, differences, keep, kept_rows, row_of
from tests.kept_rows.specs import kept_runs


def main() -> int:
    runs = kept_runs()
    made = Parallel(n_jobs=int(os.environ.get("JOBS", "-1")), return_as="generator")(
        delayed(row_of)(run) for run in runs
    )
    rows = []
    for number, row in enumerate(made, 1):
        rows.append(row)
        if number % 50 == 0:
            print(f"{number} of {len(runs)} runs", file=sys.stderr, flush=True)
    if sys.argv[1:] == ["--keep"]:
        command = ("git", "rev-parse", "--short", "HEAD")
        commit = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
        keep(rows, commit)
        return 0
    kept = kept_rows()
    exact = different = 0
    for run, before, now in zip(runs, kept["rows"], rows, strict=True):
        exact += not differences(before, now, 0.0)
        if lines := differences(before, now, ROUNDING):
            different += 1
            print(f"{run.strategy} on {run.scenario}, {run.options}:")
            print("\n".join(f"  {line}" for line in lines))
    print(
        f"{len(runs)} rows, kept by commit {kept['commit']}: {exact} equal bit for bit, "
        f"{len(runs) - exact - different} within {ROUNDING:g}, {different} differ"
    )
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
