"""A package to start a strategy of one's own from."""

import re
from importlib import resources
from pathlib import Path

from coramp.errors import CorampError
from coramp.records.files import write_text
from coramp.strategies.registry import strategies

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


def write_skeleton(name: str, folder: Path) -> Path:
    """Writes a package with a working strategy of that name and its contract test; returns it.

    Raises CorampError for a name that is not valid or already taken, and for a folder that is
    not empty.
    """
    if not NAME.fullmatch(name):
        raise CorampError(
            f"{name}: is no name; allowed are small letters, digits and single dashes"
        )
    if name in strategies():
        raise CorampError(f"{name}: there is such a strategy; use another name")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise CorampError(f"{folder}: is there already; give another by --out")
    module = f"coramp_{name.replace('-', '_')}"
    values = {
        "@NAME@": name,
        "@PACKAGE@": f"coramp-{name}",
        "@MODULE@": module,
        "@CLASS@": "".join(part.capitalize() for part in name.split("-")),
    }
    targets = {
        "pyproject.toml": "pyproject.toml",
        "strategy.py": f"{module}/__init__.py",
        "tests/test_contract.py": "tests/test_contract.py",
        "README.md": "README.md",
    }
    source = resources.files("coramp") / "data" / "skeleton"
    for template, target in targets.items():
        text = (source / f"{template}.txt").read_text(encoding="utf-8")
        for mark, value in values.items():
            text = text.replace(mark, value)
        path = folder / target
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text)
    return folder
