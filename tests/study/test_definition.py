import subprocess
import sys
from dataclasses import replace
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp import CorampError
from coramp.runs.running import RunSpec, make_spec
from coramp.studies.definition import expand, load_study, sort_key
from tests.edges import built_in, edited
from tests.study import GRID, written


def specs_of(tmp_path, text, seeds=1):
    study = load_study(written(tmp_path, text))
    return expand(study, seeds)


def grid(body, head='name = "g"\nscenario = "paper"\n'):
    return f"{head}\n[[runs]]\n{body}"


def flows(spec):
    return spec.scenario.mainline.flow_veh_h, spec.scenario.ramp.flow_veh_h


def test_flows_are_crossed_and_seeds_count_from_one(tmp_path):
    specs = specs_of(
        tmp_path,
        grid(
            'strategies = ["mainline-priority"]\nmainline_veh_h = [800, 1200]\nramp_veh_h = [5, 7]'
        ),
        seeds=3,
    )
    expected = list(product([800.0, 1200.0], [5.0, 7.0], [1, 2, 3]))
    assert [(*flows(spec), spec.seed) for spec in specs] == expected


def test_pairs_of_flows_are_not_crossed(tmp_path):
    specs = specs_of(
        tmp_path,
        grid('strategies = ["ramp-priority"]\nflows_veh_h = [[1200, 300], [800, 500]]'),
    )
    assert [flows(spec) for spec in specs] == [(800.0, 500.0), (1200.0, 300.0)]


def test_settings_are_crossed_with_flows(tmp_path):
    specs = specs_of(
        tmp_path,
        grid(
            'strategies = ["mainline-priority"]\nflows_veh_h = [[800, 200], [900, 200]]\n'
            'set = { "safety.adhesion" = [0.4, 0.1], "vehicle.length_m" = [4.0, 5.0, 6.0] }'
        ),
    )
    found = {(*flows(s), s.scenario.safety.adhesion, s.scenario.vehicle.length_m) for s in specs}
    assert found == set(product([800.0, 900.0], [200.0], [0.4, 0.1], [4.0, 5.0, 6.0]))
    assert len(specs) == len(found)


def test_only_what_differs_from_the_scenario_is_told_as_an_override(tmp_path):
    specs = specs_of(
        tmp_path,
        grid(
            'strategies = ["mainline-priority"]\nflows_veh_h = [[800, 200]]\n'
            'set = { "safety.adhesion" = [0.4, 0.1], "vehicle.length_m" = [5.0, 6.0] }'
        ),
    )
    assert {spec.keys["overrides"] for spec in specs} == {
        None,
        "safety.adhesion=0.1",
        "vehicle.length_m=6.0",
        "safety.adhesion=0.1 vehicle.length_m=6.0",
    }


def test_drivers_count_for_uncontrolled_runs_alone(tmp_path):
    specs = specs_of(tmp_path, GRID, seeds=2)
    assert [(spec.strategy, spec.drivers, spec.seed) for spec in specs] == [
        ("mainline-priority", None, 1),
        ("mainline-priority", None, 2),
        ("uncontrolled", "fair", 1),
        ("uncontrolled", "fair", 2),
        ("uncontrolled", "paper", 1),
        ("uncontrolled", "paper", 2),
    ]
    assert {spec.scenario.simulation.horizon_s for spec in specs} == {20.0}


def test_what_two_grids_share_is_run_once(tmp_path):
    one = 'strategies = ["mainline-priority"]\nflows_veh_h = [[800, 200]]\n'
    other = 'strategies = ["mainline-priority"]\nmainline_veh_h = [800, 900]\nramp_veh_h = [200]\n'
    same = f'{one}set = {{ "safety.adhesion" = [0.4] }}\n'
    specs = specs_of(tmp_path, grid(f"{one}\n[[runs]]\n{other}\n[[runs]]\n{same}"))
    assert [flows(spec) for spec in specs] == [(800.0, 200.0), (900.0, 200.0)]


def test_more_seeds_keep_the_runs_of_fewer(tmp_path):
    few, many = (specs_of(tmp_path, GRID, seeds) for seeds in (2, 4))
    assert {spec.run_id for spec in few} < {spec.run_id for spec in many}
    assert len(many) == 2 * len(few)


def test_runs_are_sorted_by_their_keys(tmp_path):
    specs = specs_of(tmp_path, GRID, seeds=12)
    assert specs == sorted(specs, key=sort_key)
    assert [spec.seed for spec in specs[:12]] == list(range(1, 13))


def test_everything_that_cannot_be_run_is_told_at_once(tmp_path):
    text = grid(
        'strategies = ["mainline-priority"]\nflows_veh_h = [[7000, 200], [800, 8000], [800, 200]]\n'
        'set = { "safety.adhesion" = [0.4, -1.0] }'
    )
    with pytest.raises(CorampError) as caught:
        specs_of(tmp_path, text, seeds=3)
    messages = caught.value.messages
    assert len(messages) == len(set(messages)) == 3
    for key in ("mainline.flow_veh_h: 7000", "ramp.flow_veh_h: 8000", "safety.adhesion: -1"):
        assert sum(key in message for message in messages) == 1


@pytest.mark.parametrize("seeds", [0, -1])
def test_a_study_needs_a_seed(tmp_path, seeds):
    with pytest.raises(CorampError, match=f"--seeds: {seeds} is too small"):
        specs_of(tmp_path, GRID, seeds)


def test_the_papers_study_holds_its_nine_flows_and_every_baseline():
    study = load_study("paper")
    specs = expand(study, 1)
    nine = set(product([800.0, 1200.0, 1800.0], [200.0, 300.0, 500.0]))
    for strategy, drivers in (
        ("mainline-priority", None),
        ("ramp-priority", None),
        *(("uncontrolled", p) for p in ("paper", "fair", "paper-sigma0", "fair-sigma0")),
    ):
        found = {flows(s) for s in specs if (s.strategy, s.drivers) == (strategy, drivers)}
        assert nine <= found
    alone = {flows(s) for s in specs if 0.0 in flows(s)}
    assert alone == {(m, 0.0) for m in (800.0, 1200.0, 1800.0)} | {
        (0.0, r) for r in (200.0, 300.0, 500.0)
    }
    assert study.seeds == 3
    assert study.layout == "paper"
    assert {spec.scenario.simulation.horizon_s for spec in specs} == {1800.0}


def test_the_sensitivity_study_changes_one_thing_at_a_time():
    specs = expand(load_study("sensitivity"), 1)
    settings = {}
    for spec in specs:
        settings.setdefault(spec.keys["overrides"], set()).add(flows(spec))
    assert all(len(pairs) == 5 for pairs in settings.values())
    assert len({frozenset(pairs) for pairs in settings.values()}) == 1
    assert None in settings
    assert all(" " not in (setting or "") for setting in settings)
    assert len(settings) == 1 + 4 + 3 + 2 + 4


class TestRunId:
    SPEC = make_spec("paper", "uncontrolled", drivers="paper", seed=3)

    def test_it_is_the_same_in_another_process(self):
        code = (
            "from coramp.runs.running import make_spec\n"
            "print(make_spec('paper', 'uncontrolled', drivers='paper', seed=3).run_id)\n"
        )
        result = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        assert result.stdout.strip() == self.SPEC.run_id

    def test_it_does_not_depend_on_how_a_value_was_given(self, tmp_path):
        text = edited(
            built_in("scenarios", "paper"),
            {"flow_veh_h = 1800.0": "flow_veh_h = 900", "sigma = 0.5": "sigma = 0.50"},
        )
        path = tmp_path / "mine.toml"
        path.write_text(text)
        ids = {
            make_spec("paper", mainline_veh_h=900.0).run_id,
            make_spec("paper", mainline_veh_h=900).run_id,
            make_spec("paper", overrides={"mainline.flow_veh_h": 900}).run_id,
            make_spec(str(path)).run_id,
            make_spec(str(path), overrides={"control.step_s": 0.1}).run_id,
        }
        assert len(ids) == 1

    def test_every_part_of_the_specification_counts(self):
        changes = [
            {"strategy": "mainline-priority"},
            {"engine": "exact"},
            {"drivers": "fair"},
            {"drivers": None},
            {"seed": 4},
        ]
        ids = [self.SPEC.run_id, *(replace(self.SPEC, **change).run_id for change in changes)]
        assert len(set(ids)) == len(ids)

    def test_what_was_set_counts_by_what_it_sets(self):
        labelled = replace(self.SPEC, overrides=(("anything", 1),))
        assert labelled.run_id == self.SPEC.run_id

    @pytest.mark.parametrize(
        "target", ["coramp.runs.running.RESULT_VERSION", "coramp.runs.running.metadata.version"]
    )
    def test_versions_count(self, monkeypatch, target):
        changed = 99 if target.endswith("RESULT_VERSION") else (lambda _: "9.9.9")
        monkeypatch.setattr(target, changed)
        assert replace(self.SPEC).run_id != self.SPEC.run_id

    @pytest.mark.filterwarnings("ignore:Pydantic serializer warnings")
    def test_every_single_value_of_the_scenario_counts(self):
        seen = {self.SPEC.run_id}
        count = 0
        for path in leaves(self.SPEC.scenario.model_dump(mode="json")):
            changed = replace(self.SPEC, scenario=with_other_value(self.SPEC.scenario, path))
            seen.add(changed.run_id)
            count += 1
        assert count > 50
        assert len(seen) == count + 1

    @given(st.integers(0, 2**31 - 1), st.integers(0, 2**31 - 1))
    def test_two_seeds_are_two_runs(self, one, other):
        ids = [replace(self.SPEC, seed=seed).run_id for seed in (one, other)]
        assert (ids[0] == ids[1]) == (one == other)


def leaves(data, path=()):
    if isinstance(data, dict):
        for key, value in data.items():
            yield from leaves(value, (*path, key))
    else:
        yield path


def with_other_value(model, path):
    """Returns a copy in which one value is another, whether that is allowed or not."""
    key, *rest = path
    if isinstance(model, dict):
        return {**model, key: with_other_value(model[key], rest)}
    value = getattr(model, key)
    if rest:
        changed = with_other_value(value, rest)
    elif isinstance(value, tuple):
        changed = (*value, "more")
    else:
        changed = f"not {value}"
    return model.model_copy(update={key: changed})


def test_a_specification_is_plain_data_with_its_scenario_in_full():
    data = make_spec("paper", mainline_veh_h=700.0, overrides={"safety.adhesion": 0.2}).as_data()
    assert data["mainline_veh_h"] == 700.0
    assert data["overrides"] == "safety.adhesion=0.2"
    assert data["specification"]["mainline"]["flow_veh_h"] == 700.0
    assert data["specification"]["safety"]["adhesion"] == 0.2
    assert data["specification"]["ramp"]["limit_mps"] == 17.0


def test_cooperative_runs_have_no_drivers():
    assert make_spec("paper", drivers="paper").drivers is None
    assert make_spec("paper", "uncontrolled").drivers == "fair"


def test_a_run_is_a_value():
    one, other = make_spec("paper", seed=5), make_spec("paper", seed=5)
    assert one == other
    assert isinstance(one, RunSpec)
    with pytest.raises(AttributeError):
        one.seed = 6


def test_drivers_are_those_beside_a_mixed_strategy_and_nobody_s_where_all_are_automated(tmp_path):
    specs = specs_of(
        tmp_path,
        grid(
            'strategies = ["mixed-slots", "slots", "uncontrolled"]\n'
            'drivers = ["fair", "credible"]\n'
            'flows_veh_h = [[1200, 300]]\nset = { "traffic.automated_share" = [1.0] }'
        ),
    )
    assert [(s.strategy, s.drivers) for s in specs] == [
        ("mixed-slots", None),
        ("slots", None),
        ("uncontrolled", "credible"),
        ("uncontrolled", "fair"),
    ]
    specs = specs_of(
        tmp_path,
        grid(
            'strategies = ["mixed-slots"]\ndrivers = ["fair", "credible"]\n'
            'flows_veh_h = [[1200, 300]]\nset = { "traffic.automated_share" = [0.5, 1.0] }'
        ),
    )
    found = [(s.drivers, s.scenario.traffic.automated_share) for s in specs]
    assert found == [(None, 1.0), ("credible", 0.5), ("fair", 0.5)]
