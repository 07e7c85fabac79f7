"""Writing result files so that none is ever half there, and owning the folders they lie in."""

import io
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl

from coramp.errors import CorampError


def write_text(path: Path, text: str) -> None:
    """Writes a file under another name, then renames it into place."""
    with _replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_bytes(path: Path, content: bytes) -> None:
    """Writes a file of bytes in the same way."""
    with _replacing(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: Path, data: Any) -> None:
    """Writes JSON; numbers that it has no word for must have been taken out."""
    write_text(path, json.dumps(data, indent=2, allow_nan=False) + "\n")


def write_parquet(path: Path, frame: pl.DataFrame) -> None:
    """Writes a table."""
    content = io.BytesIO()
    frame.write_parquet(content)
    write_bytes(path, content.getvalue())


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.replace(path)
    except OSError as error:
        raise CorampError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        temporary.unlink(missing_ok=True)


def read_json(path: Path) -> Any:
    """Returns the content of a JSON file; raises CorampError where it is missing or damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise CorampError(f"{path}: no such file; give a folder that coramp has written") from None
    except (OSError, ValueError) as error:
        raise CorampError(f"{path}: cannot be read: {error}; run again to write it anew") from error


def made_folder(path: Path) -> Path:
    """Returns the folder, made if need be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise CorampError(
            f"{path}: cannot be written: {error.strerror}; give another folder"
        ) from error
    return path


@contextmanager
def staged_folder(target: Path, mark: str) -> Iterator[Path]:
    """Gives a folder to write into that takes the place of ``target`` once all is written.

    ``mark`` is the file that tells what a folder holds: a folder with that file is replaced, an
    empty one is used, and any other is refused with CorampError before anything is computed.
    """
    _check_ours(target, mark)
    parent = made_folder(target.absolute().parent)
    stage = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=parent))
    try:
        yield stage
        stage.chmod(0o755)
        if target.exists():
            shutil.rmtree(target)
        stage.rename(target)
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _check_ours(target: Path, mark: str) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise CorampError(f"{target}: is a file; give a folder")
    content = sorted(entry.name for entry in target.iterdir())
    if content and mark not in content:
        what = "a study" if "study.json" in content else f"other files ({content[0]})"
        raise CorampError(f"{target}: holds {what}; give another or an empty folder")
