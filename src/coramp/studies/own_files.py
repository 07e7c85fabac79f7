"""The files of one's own that a study is made of: its own one, and that of its scenario."""

from pathlib import Path

from coramp.scenarios.toml_files import builtin_names
from coramp.studies.definition import Study


def own_files(study: Study) -> dict[str, str]:
    """Returns the text of each file by the name to keep it under, the study's own one first.

    The scenario's name is its path as the study gives it. What is built in is no file, and so is
    what cannot be read by now.
    """
    found = {}
    if study.file is not None and study.file not in builtin_names("studies"):
        found[Path(study.file).name] = Path(study.file)
    if study.scenario not in builtin_names("scenarios"):
        found[study.scenario] = Path(study.source)
    return {name: text for name, path in found.items() if (text := _text(path)) is not None}


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
