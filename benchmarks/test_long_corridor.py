"""A corridor of 10 km against plain sumo on the same files: a ratio of processor time."""

from benchmarks.long_corridor import in_own_process, written

VEHICLES = 1_250
AT_MOST, AIM = 5.0, 1.5
"""With all vehicles automated; the aim is not reached."""


def test_long_corridor_against_plain_sumo(benchmark, tmp_path):
    scenario, rows = written(tmp_path), []
    in_own_process(scenario, "100 %", 25, tmp_path)  # compiles what is not cached

    def one_round():
        rows.append(in_own_process(scenario, "100 %", VEHICLES, tmp_path))

    benchmark.pedantic(one_round, rounds=1, iterations=1)
    (row,) = rows
    ratio = row["cpu_s"] / row["plain"]["cpu_s"]
    print(
        f"\n10 km, 5 ramps, 100 % automated, {row['vehicles']} vehicles: {row['cpu_s']:.1f} s, "
        f"plain sumo {row['plain']['cpu_s']:.1f} s, ratio {ratio:.2f} (aim {AIM}, at most "
        f"{AT_MOST}); {row['memory_mb']:.0f} MB"
    )
    assert row["unserved"] == row["collisions_by_automated"] == 0
    assert ratio <= AT_MOST
