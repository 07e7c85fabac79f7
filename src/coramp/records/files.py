"""Writing result files so that none is ever half there, and reading them back."""

import io
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import polars as pl

from coramp.errors import CorampError
from coramp.records.unfinished import sweep, unfinished


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
    _sweep_once(path.parent)
    try:
        with unfinished(path.parent, path.name) as temporary:
            yield temporary
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
            temporary.replace(path)
    except OSError as error:
        raise CorampError(f"{path}: cannot be written: {error.strerror}") from error


@cache
def _sweep_once(folder: Path) -> None:
    """Once in a process: a study writes a hundred thousand files into one folder."""
    sweep(folder)


def read_json(path: Path) -> Any:
    """Returns the content of a JSON file; raises CorampError where it is missing or damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_json)
    except FileNotFoundError:
        raise CorampError(f"{path}: no such file; give a folder that coramp has written") from None
    except (OSError, ValueError, RecursionError) as error:
        raise CorampError(f"{path}: cannot be read: {error}; run again to write it anew") from error


def _no_json(constant: str) -> None:
    raise ValueError(f"{constant} is no JSON")


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
