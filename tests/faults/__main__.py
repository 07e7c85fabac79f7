"""``python -m tests.faults``: each fault by itself, and who caught it; 1 if one is not caught."""

import sys
import tempfile
from pathlib import Path

from tests.faults.catching import catch, usual_refusals
from tests.faults.faults import FAULTS


def main() -> int:
    missed = 0
    print("| fault | caught by | told |\n|---|---|---|")
    for fault in FAULTS:
        with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
            found = catch(fault, Path(one), usual_refusals(fault, Path(other)))
        missed += not found.by
        print(f"| {fault.name} | {found.by or 'nobody'} | {found.told[:110]} |", flush=True)
    print(f"\n{len(FAULTS) - missed} of {len(FAULTS)} caught")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
