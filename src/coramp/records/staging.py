"""Replacing a folder of results as a whole, without deleting what coramp did not write."""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from coramp.errors import CorampError
from coramp.records.files import made_folder
from coramp.records.unfinished import is_unfinished, sweep, unfinished

Obstacle = Callable[[Path], str | None]
"""Says why a folder must not be replaced, and what to do; None where it may be."""


@contextmanager
def staged_folder(target: Path, obstacle: Obstacle) -> Iterator[Path]:
    """Gives a folder to write into that takes the place of ``target`` once all is written.

    An empty folder and one without an ``obstacle`` are replaced. Any other is refused with
    CorampError before anything is computed. If an obstacle comes up meanwhile, both folders stay
    and CorampError says where the new one lies. A link to a folder is followed.
    """
    place = _followed(target)
    _check(target, place, obstacle)
    within = place.is_dir() and _cannot_be_renamed(place)
    parent = made_folder(place if within else place.parent)
    sweep(parent)
    with unfinished(parent, place.name, is_folder=True) as stage:
        yield stage
        stage.chmod(0o755)
        try:
            _put_in_place(stage, place, obstacle, within)
        except (OSError, CorampError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            kept = _kept(stage, place)
            raise CorampError(
                f"{target}: cannot be replaced: {reason}; the new results are in {kept}"
            ) from error


def _followed(target: Path) -> Path:
    try:
        place = target.resolve()
    except (OSError, RuntimeError):  # links in a circle
        place = target.absolute()
    if target.is_symlink() and not place.exists():
        raise CorampError(f"{target}: is a link to nothing; give a folder")
    return place


def _check(target: Path, place: Path, obstacle: Obstacle) -> None:
    if not place.exists():
        return
    if not place.is_dir():
        raise CorampError(f"{target}: is a file; give a folder")
    if (problem := _problem(place, obstacle)) is not None:
        raise CorampError(f"{target}: {problem}")


def _problem(folder: Path, obstacle: Obstacle) -> str | None:
    content = any(not is_unfinished(entry.name) for entry in folder.iterdir())
    return obstacle(folder) if content else None


def _cannot_be_renamed(folder: Path) -> bool:
    """Whether its content has to be exchanged, as it is mounted, or some shell stands in it."""
    try:
        return folder.is_mount() or Path.cwd().is_relative_to(folder)
    except FileNotFoundError:  # this process stands in a folder that is gone
        return folder.is_mount()


def _put_in_place(stage: Path, place: Path, obstacle: Obstacle, within: bool) -> None:
    """Moves the old folder aside, looks at it once more, and moves the new one in."""
    if not place.exists():
        stage.rename(place)
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{place.name}.before.", dir=stage.parent))
    moves = [(place, aside / place.name)]
    if within:
        hidden = {stage, aside}
        moves = [(old, aside / old.name) for old in place.iterdir() if old not in hidden]
    done: list[tuple[Path, Path]] = []
    try:
        _move(moves, done)
        if (problem := _problem(aside if within else aside / place.name, obstacle)) is not None:
            raise CorampError(problem)
        new = [(entry, place / entry.name) for entry in stage.iterdir()]
        _move(new if within else [(stage, place)], done)
    except BaseException:
        for old, moved in reversed(done):
            moved.rename(old)
        aside.rmdir()
        raise
    shutil.rmtree(aside)


def _move(moves: list[tuple[Path, Path]], done: list[tuple[Path, Path]]) -> None:
    for old, new in moves:
        old.rename(new)
        done.append((old, new))


def _kept(stage: Path, place: Path) -> Path:
    """Gives the new folder a name of its own beside the old one, and returns that."""
    for number in count(1):
        kept = stage.parent / f"{place.name}-new{number}"
        if not kept.exists():
            break
    stage.rename(kept)
    return kept
