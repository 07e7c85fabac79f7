"""``python -m tests.wheel``: builds sdist and wheel, and runs the wheel where nothing else is.

One environment for each Python that ``pyproject.toml`` claims and this machine has. In each of them
the wheel is installed at the versions of ``constraints.txt``, without extras, and run from an empty
folder. All must give the same figures. ``--uncompiled`` runs the kernels as plain Python: compiling
them takes a minute or two in each environment.
"""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CLAIM = "Programming Language :: Python :: 3."
NEEDED = ("coramp/py.typed", "coramp/data/scenarios/paper.toml", "licenses/LICENSE")
RUN = ("run", "paper", "--seed", "3", "--horizon", "20", "--json")
COMMANDS: tuple[tuple[str, ...], ...] = (
    ("plan", "example", "--json"),
    (*RUN, "--engine", "exact", "--out", "r"),
    (*RUN, "--strategy", "uncontrolled"),
)
MEASURED = ("wall_s", "planning_median_s", "planning_p95_s")


def main() -> int:
    with tempfile.TemporaryDirectory(prefix="coramp-wheel-") as name:
        place = Path(name)
        wheel = built(place / "dist")
        found = {}
        for version, python in pythons():
            started = time.monotonic()
            found[version] = figures(python, wheel, place / version)
            print(f"Python {version}: works ({time.monotonic() - started:.0f} s)", flush=True)
    claimed = {line.removeprefix("Programming Language :: Python :: ") for line in claims()}
    if missing := sorted(claimed - found.keys()):
        print(f"Not tried, as this machine has no such Python: {', '.join(missing)}")
    if any(figure != next(iter(found.values())) for figure in found.values()):
        print("Error: the figures differ from one Python to another", file=sys.stderr)
        return 1
    return 0 if found else 1


def built(dist: Path) -> Path:
    """Builds both, the wheel from the sdist, and returns the wheel."""
    called(sys.executable, "-m", "build", "--no-isolation", "--outdir", str(dist), str(ROOT))
    (wheel,), (sdist,) = dist.glob("*.whl"), dist.glob("*.tar.gz")
    names = zipfile.ZipFile(wheel).namelist()
    lacking = [needed for needed in NEEDED if not any(n.endswith(needed) for n in names)]
    strange = [n for n in names if not n.startswith(("coramp/", f"coramp-{PROJECT['version']}."))]
    with tarfile.open(sdist) as archive:
        lacking += [n for n in ("README.md", "CITATION.cff") if not _holds(archive, n)]
    if lacking or strange:
        raise SystemExit(f"Error: the distribution lacks {lacking}, and holds {strange}")
    print(f"Built: {wheel.name} ({wheel.stat().st_size / 1e3:.0f} kB), {sdist.name}", flush=True)
    return wheel


def _holds(archive: tarfile.TarFile, name: str) -> bool:
    return any(
        member.count("/") == 1 and member.endswith(f"/{name}") for member in archive.getnames()
    )


def claims() -> list[str]:
    return [line for line in PROJECT["classifiers"] if line.startswith(CLAIM)]


def pythons() -> Iterator[tuple[str, str]]:
    """Yields each claimed version that is here, and the interpreter."""
    this = f"3.{sys.version_info.minor}"
    yield this, sys.executable
    for line in claims():
        version = line.removeprefix("Programming Language :: Python :: ")
        if version != this:
            usable = (path for path in _candidates(version) if _is(path, version))
            if (path := next(usable, None)) is not None:
                yield version, path


def _candidates(version: str) -> Iterator[str]:
    if (path := shutil.which(f"python{version}")) is not None:
        yield path
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    yield from map(str, sorted(root.glob(f"versions/{version}.*/bin/python")))


def _is(path: str, version: str) -> bool:
    program = "import ensurepip, sys; print('%d.%d' % sys.version_info[:2])"
    told = subprocess.run([path, "-c", program], capture_output=True, text=True, check=False)
    return told.returncode == 0 and told.stdout.strip() == version


def figures(python: str, wheel: Path, place: Path) -> list[Any]:
    """Installs the wheel, runs it, and returns what its commands told, times left out."""
    called(python, "-m", "venv", str(place / "env"))
    binaries, empty = place / "env" / "bin", place / "empty"
    options = ("--quiet", "--disable-pip-version-check", "--constraint", ROOT / "constraints.txt")
    called(str(binaries / "pip"), "install", *map(str, options), str(wheel))
    empty.mkdir()
    coramp = str(binaries / "coramp")
    version = called(coramp, "--version", within=empty)
    if version != f"coramp {PROJECT['version']}\n":
        raise SystemExit(f"Error: --version says {version!r}")
    told = [json.loads(called(coramp, *command, within=empty)) for command in COMMANDS]
    called(coramp, "report", "r", within=empty)
    called(str(binaries / "python"), "-m", "coramp", "explain", "r", "r00001", within=empty)
    return [_without_times(answer) for answer in told]


def _without_times(answer: dict[str, Any]) -> dict[str, Any]:
    summary = {k: v for k, v in answer.get("summary", {}).items() if k not in MEASURED}
    return {**answer, "summary": summary, "versions": None}


def called(*command: str, within: Path | None = None) -> str:
    """Returns what a command prints; one that fails ends everything, with what it said."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    if "--uncompiled" in sys.argv[1:]:
        environment["NUMBA_DISABLE_JIT"] = "1"
    told = subprocess.run(
        command, cwd=within, env=environment, capture_output=True, text=True, check=False
    )
    if told.returncode:
        raise SystemExit(f"Error: {' '.join(command)}: {told.stdout[-2000:]}{told.stderr[-2000:]}")
    return told.stdout


if __name__ == "__main__":
    sys.exit(main())
