import json
import math
import os

import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from coramp import CorampError
from coramp.records.schemas import RUNS, STREAM_ROWS
from coramp.runs.running import make_spec
from coramp.studies.definition import load_study
from coramp.studies.store import Part, Store
from tests.study import run_row, written

SPEC = make_spec("paper", seed=1)
OTHER = make_spec("paper", seed=2)


def part_of(spec, **figures):
    run = run_row(**figures) | spec.keys | {"run_id": spec.run_id}
    streams = [
        {"run_id": spec.run_id, **dict.fromkeys(list(STREAM_ROWS)[1:]), "stream": stream}
        for stream in ("mainline", "ramp")
    ]
    return Part(run, streams)


@pytest.fixture
def study(tmp_path):
    return load_study(written(tmp_path))


@pytest.fixture
def store(tmp_path, study):
    return Store(tmp_path / "o", study)


def test_what_is_written_is_read_back_to_the_last_digit(store):
    part = part_of(
        SPEC,
        mainline_delay_s=0.1 + 0.2,
        min_ttc_s=None,
        max_severity=math.inf,
        min_margin_m=-math.inf,
        overrides="a=1 b=±",
    )
    store.write(SPEC, part)
    assert store.read(SPEC) == part
    assert not store.is_damaged(SPEC)
    assert store.read(OTHER) is None
    assert not store.is_damaged(OTHER)


def test_a_part_is_plain_json(store):
    store.write(SPEC, part_of(SPEC, max_severity=math.inf))
    content = json.loads(store.part_path(SPEC).read_text(), parse_constant=pytest.fail)
    assert content["run"]["run_id"] == SPEC.run_id
    assert store.part_path(SPEC).name == f"{SPEC.run_id}.json"


@given(data=st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_change_of_a_part_is_found(store, data):
    part = part_of(SPEC, mainline_delay_s=1.25, fuel_l=3.5)
    store.write(SPEC, part)
    path = store.part_path(SPEC)
    content = bytearray(path.read_bytes())
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    found = store.read(SPEC)
    assert found is None or found == part  # what JSON reads the same is the same
    assert store.is_damaged(SPEC) == (found is None)


@given(share=st.floats(0.0, 0.999))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_half_a_part_is_found(store, share):
    store.write(SPEC, part_of(SPEC))
    path = store.part_path(SPEC)
    content = path.read_bytes().rstrip()
    path.write_bytes(content[: int(share * len(content))])
    assert store.read(SPEC) is None
    assert store.is_damaged(SPEC)


@pytest.mark.parametrize("content", ["", "null", "[]", "3", "{}", '{"run": {}}', '"text"'])
def test_what_is_no_part_is_damaged(store, content):
    store.part_path(SPEC).write_text(content)
    assert store.read(SPEC) is None
    assert store.is_damaged(SPEC)


def test_a_file_that_is_still_being_written_never_counts(store):
    store.write(SPEC, part_of(SPEC))
    whole = store.part_path(SPEC)
    whole.rename(whole.with_name(f".{whole.name}.{os.getpid()}"))
    assert store.read(SPEC) is None
    assert not store.is_damaged(SPEC)


def test_a_part_of_another_run_does_not_stand_for_this_one(store):
    store.write(OTHER, part_of(OTHER))
    store.part_path(OTHER).rename(store.part_path(SPEC))
    found = store.read(SPEC)
    assert found is None or found.run["run_id"] == SPEC.run_id


def test_a_failed_run_is_neither_done_nor_damaged(store):
    store.write(SPEC, part_of(SPEC, status="failed", error="SUMO: x"))
    assert store.read(SPEC) is None
    assert not store.is_damaged(SPEC)


def test_tables_keep_types_and_the_order_of_parts(store):
    parts = [part_of(OTHER, rung_free=3), part_of(SPEC, mainline_delay_s=0.5)]
    runs, streams = store.frames(parts)
    assert dict(runs.schema) == RUNS
    assert dict(streams.schema) == STREAM_ROWS
    assert runs["run_id"].to_list() == [OTHER.run_id, SPEC.run_id]
    assert streams["run_id"].to_list() == [OTHER.run_id] * 2 + [SPEC.run_id] * 2
    store.write_tables(runs, streams, "# Study\n")
    assert pl.read_parquet(store.folder / "runs.parquet").equals(runs)
    assert pl.read_parquet(store.folder / "streams.parquet").equals(streams)
    assert (store.folder / "tables.md").read_text() == "# Study\n"


def test_no_parts_are_empty_tables_with_all_columns(store):
    runs, streams = store.frames([])
    assert (dict(runs.schema), runs.height) == (RUNS, 0)
    assert (dict(streams.schema), streams.height) == (STREAM_ROWS, 0)


def test_the_same_study_opens_its_folder_again(tmp_path, store, study):
    store.write(SPEC, part_of(SPEC))
    assert Store(tmp_path / "o", study).read(SPEC) == part_of(SPEC)


def test_the_folder_says_which_study_it_holds_and_with_which_versions(store, study):
    mark = json.loads((store.folder / "study.json").read_text())
    assert mark["kind"] == "study"
    assert mark["study"] == study.model_dump(mode="json")
    assert {"coramp", "libsumo", "python"} <= set(mark["versions"])


@pytest.mark.parametrize(
    "change",
    [
        {"seeds": 3},
        {"horizon_s": 30.0},
        {"name": "other"},
        {"layout": "paper"},
        {"scenario": "expressway"},
    ],
)
def test_another_definition_is_another_study(tmp_path, store, study, change):
    with pytest.raises(CorampError, match="holds another study"):
        Store(tmp_path / "o", study.model_copy(update=change))


def test_an_empty_folder_is_used_and_a_foreign_one_is_not(tmp_path, study):
    (tmp_path / "empty").mkdir()
    assert Store(tmp_path / "empty", study).folder == tmp_path / "empty"
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "x").write_text("")
    with pytest.raises(CorampError, match="holds other files and no study"):
        Store(tmp_path / "foreign", study)
    assert os.listdir(tmp_path / "foreign") == ["x"]  # noqa: PTH208
