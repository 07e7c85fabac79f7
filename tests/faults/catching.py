"""Puts a fault into a copy of coramp, drives a run with it, and tells who noticed."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from tests.faults.fault import Fault

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src"
TESTS_FAILED = 1
"""What pytest ends with where tests fail; anything else is that they could not be run."""


class Caught(NamedTuple):
    """Who noticed a fault, what was said, and how many plans the checker refused.

    ``by`` is empty where nobody noticed.
    """

    by: str
    told: str
    refused: int = 0


def catch(fault: Fault, folder: Path, usual: int = 0) -> Caught:
    """Returns who notices a fault: the run itself, or the audit of what it left.

    ``usual`` is how many plans the checker refuses without the fault.

    The audit runs with the fault, too: that it would decide otherwise without is no help. Kernels
    run as plain Python, so that nothing is compiled anew for each fault.
    """
    copy = folder / "src"
    shutil.copytree(SOURCE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    for edit in fault.edits:
        path = copy / "coramp" / edit.path
        text = path.read_text()
        if (times := text.count(edit.before)) != 1:
            raise ValueError(f"{edit.path}: {edit.before!r} stands there {times} times")
        path.write_text(text.replace(edit.before, edit.after))
    if not fault.run:
        return _by_its_test(fault, copy, 0)
    run = folder / "run"
    driven = _coramp(copy, "run", *fault.run, "--out", str(run), "--keep-messages")
    if driven.returncode:
        return Caught("the run", _first_line(driven.stderr))
    summary = json.loads((run / "run.json").read_text())["summary"]
    refused = (summary["refused_plans"] or 0) + (summary["interventions"] or 0)
    if refused > usual:
        return Caught("the checker", f"{refused} plans refused, {usual} without the fault", refused)
    audited = _coramp(copy, "audit", str(run), "--json")
    if audited.returncode == 0:
        return _by_its_test(fault, copy, refused)
    return Caught("the audit", _contradiction(audited), refused)


def _by_its_test(fault: Fault, copy: Path, refused: int) -> Caught:
    if not fault.test:
        return Caught("", "confirmed", refused)
    tested = _python(copy, "pytest", "-q", "-x", "-p", "no:cacheprovider", fault.test)
    if tested.returncode == 0:
        return Caught("", "confirmed, and its test passes", refused)
    if tested.returncode != TESTS_FAILED:
        raise ValueError(f"{fault.name}: {fault.test} does not run: {tested.stdout[-500:]}")
    return Caught("a test", fault.test.split("::")[1], refused)


def usual_refusals(fault: Fault, folder: Path) -> int:
    """Returns how many plans are refused in the run of a fault without the fault.

    Raises ValueError where even then somebody else complains.
    """
    found = catch(fault._replace(edits=()), folder, usual=1 << 30)
    if found.by:
        raise ValueError(f"{fault.name}: without the fault {found.by} says: {found.told}")
    return found.refused


def _coramp(source: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return _python(source, "coramp", *words)


def _python(source: Path, module: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs a module of Python with coramp from a folder, and kernels as plain Python."""
    return subprocess.run(
        [sys.executable, "-m", module, *words],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(source), "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


def _first_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.startswith(("Error", "Unsafe"))]
    return (lines or text.splitlines() or ["nothing"])[0]


def _contradiction(audited: subprocess.CompletedProcess[str]) -> str:
    try:
        claims = json.loads(audited.stdout)["checks"]
    except (ValueError, KeyError):
        return _first_line(audited.stderr)
    wrong = [
        f"{claim['claim']}: {claim['how']}" for claim in claims if claim["verdict"] != "confirmed"
    ]
    return wrong[0] if wrong else "contradicted"
