import json
import math
import os

import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp import CorampError
from coramp.records.files import (
    made_folder,
    read_json,
    write_json,
    write_parquet,
    write_text,
)
from coramp.runs.running import finite_or_none
from tests.edges import everything_below


class Stopped(BaseException):
    """Stands for whatever ends a process at the wrong moment."""


def test_what_is_written_is_read_back(tmp_path):
    frame = pl.DataFrame({"a": [1.5, None], "b": ["x", "y"]})
    write_json(tmp_path / "a.json", {"a": [1, None, 0.1], "b": "±"})
    write_parquet(tmp_path / "a.parquet", frame)
    write_text(tmp_path / "a.txt", "± text\n")
    assert read_json(tmp_path / "a.json") == {"a": [1, None, 0.1], "b": "±"}
    assert pl.read_parquet(tmp_path / "a.parquet").equals(frame)
    assert (tmp_path / "a.txt").read_bytes() == "± text\n".encode()
    assert everything_below(tmp_path) == ["a.json", "a.parquet", "a.txt"]


def test_a_file_is_replaced_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    write_text(path, "before")

    def stopped(*_):
        assert path.read_text() == "before"
        raise Stopped

    monkeypatch.setattr(os, "fsync", stopped)
    with pytest.raises(Stopped):
        write_text(path, "after, and longer")
    assert path.read_text() == "before"
    assert everything_below(tmp_path) == ["a.txt"]


def test_who_reads_the_old_file_goes_on_reading_it(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "before")
    with path.open() as reader:
        write_text(path, "after")
        assert reader.read() == "before"
    assert path.read_text() == "after"


def test_a_full_disk_is_told_and_leaves_the_file_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    write_text(path, "before")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CorampError) as caught:
        write_text(path, "after")
    assert caught.value.messages == (f"{path}: cannot be written: No space left on device",)
    assert path.read_text() == "before"
    assert everything_below(tmp_path) == ["a.txt"]


def test_a_missing_folder_is_told(tmp_path):
    with pytest.raises(CorampError, match="cannot be written: No such file or directory"):
        write_text(tmp_path / "nowhere" / "a.txt", "text")
    assert everything_below(tmp_path) == []


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_json_holds_no_numbers_that_it_has_no_word_for(tmp_path, value):
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "a.json", {"a": value})
    assert everything_below(tmp_path) == []


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=6,
)


@given(anything)
def test_numbers_without_a_word_become_none_and_nothing_else_changes(data):
    cleaned = finite_or_none(data)
    assert json.loads(json.dumps(cleaned, allow_nan=False)) == cleaned

    def same(before, after):
        if isinstance(before, float) and not math.isfinite(before):
            return after is None
        if isinstance(before, dict):
            return before.keys() == after.keys() and all(same(before[k], after[k]) for k in before)
        if isinstance(before, list):
            return len(before) == len(after) and all(map(same, before, after))
        return before == after

    assert same(data, cleaned)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[1,"])
def test_damaged_json_is_told(tmp_path, content):
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(CorampError) as caught:
        read_json(path)
    assert str(caught.value).startswith(f"{path}: cannot be read: ")


def test_missing_json_is_told(tmp_path):
    with pytest.raises(CorampError, match="no such file"):
        read_json(tmp_path / "a.json")
    with pytest.raises(CorampError, match="cannot be read"):
        read_json(tmp_path)


def test_folders_are_made_with_all_above_them(tmp_path):
    folder = made_folder(tmp_path / "a" / "b")
    assert folder.is_dir()
    assert made_folder(folder) == folder
    assert everything_below(folder) == []


def test_a_folder_cannot_be_made_where_a_file_is(tmp_path):
    (tmp_path / "a").write_text("")
    for path in (tmp_path / "a", tmp_path / "a" / "b"):
        with pytest.raises(CorampError, match=r"cannot be written: .*; give another folder"):
            made_folder(path)
