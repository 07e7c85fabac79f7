"""Files of counts: what is read from each format, and what is told of one that does not add up."""

import codecs

import polars as pl
import pytest

from coramp.demand.counts import SCHEMA, read_counts
from coramp.errors import CorampError

HEAD = "begin_s,end_s,detector,lane,class,vehicles,mean_speed_mps"
ROWS = (
    "0,300,M,0,car,100,24.5",
    "0,300,M,0,truck,10,22",
    "0,300,R,0,car,20,15",
    "300,600,M,0,car,120,24",
    "300,600,M,0,truck,12,22",
    "300,600,R,0,car,25,15.5",
    "600,900,M,0,car,90,24",
    "600,900,M,0,truck,9,22",
    "600,900,R,0,car,21,15",
)


def table(*rows, head=HEAD):
    return "\n".join((head, *rows)) + "\n"


@pytest.fixture
def file(tmp_path):
    def written(content, name="counts.csv"):
        path = tmp_path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content, encoding="utf-8")
        return path

    return written


def told(path, **options):
    with pytest.raises(CorampError) as caught:
        read_counts(path, **options)
    return [line.removeprefix(f"{path}: ") for line in caught.value.messages]


def vehicles(counts, detector="M", kind="car"):
    here = counts.at(detector).filter(pl.col("vehicle_class") == kind)
    return here["vehicles"].to_list()


def replaced(place, row):
    return [*ROWS[:place], row, *ROWS[place + 1 :]]


def test_every_column_is_read(file):
    counts = read_counts(file(table(*ROWS)))
    assert dict(counts.frame.schema) == SCHEMA
    assert counts.detectors == ["M", "R"]
    assert counts.classes == ["car", "truck"]
    assert (counts.begin_s, counts.end_s, counts.interval_s) == (0.0, 900.0, 300.0)
    assert vehicles(counts) == [100, 120, 90]
    assert counts.at("R")["mean_speed_mps"].to_list() == [15.0, 15.5, 15.0]
    assert counts.repairs == ()


def test_stamps_edges_hourly_flows_and_km_per_hour(file):
    head = "time;edge;flow_veh_h;mean_speed_kmh"
    rows = ("2026-05-11 07:00;A;1200;90", "2026-05-11 07:05;A;600;72", "2026-05-11 07:10;A;12;")
    counts = read_counts(file(table(*rows, head=head)))
    assert vehicles(counts, "A") == [100, 50, 1]
    assert counts.frame["mean_speed_mps"].to_list() == [25.0, 20.0, None]
    assert counts.frame["lane"].to_list() == [None] * 3
    assert counts.frame["end_s"].to_list() == [300.0, 600.0, 900.0]
    assert str(counts.start) == "2026-05-11 07:00:00"


def test_parquet_gives_what_csv_gives(file, tmp_path):
    path = file(table(*ROWS))
    pl.read_csv(path).write_parquet(tmp_path / "counts.parquet")
    assert read_counts(tmp_path / "counts.parquet").frame.equals(read_counts(path).frame)


def test_rows_may_come_in_any_order(file):
    assert read_counts(file(table(*ROWS[::-1]))).frame.equals(
        read_counts(file(table(*ROWS), "b.csv")).frame
    )


def test_what_is_written_is_read_back(file, tmp_path):
    counts = read_counts(file(table(*ROWS)))
    counts.frame.write_csv(tmp_path / "again.csv")
    assert read_counts(tmp_path / "again.csv").frame.equals(counts.frame)


def test_dfrouter(file):
    text = "Detector;Time;qPKW;vPKW;qLKW;vLKW\nD;0;10;90;2;72\nD;1;11;0;0;0\nD;2;9;99;1;81\n"
    counts = read_counts(file(text))
    assert vehicles(counts, "D") == [10, 11, 9]
    assert vehicles(counts, "D", "truck") == [2, 0, 1]
    assert counts.frame["end_s"].to_list() == [60.0, 60.0, 120.0, 120.0, 180.0, 180.0]
    assert counts.frame["mean_speed_mps"].to_list() == [25.0, 20.0, 0.0, None, 27.5, 22.5]


def test_induction_loops(file):
    text = """<?xml version="1.0"?>
<detector>
   <interval begin="0.00" end="60.00" id="D" nVehContrib="7" flow="420.00" speed="25.5"/>
   <interval begin="60.00" end="120.00" id="D" nVehContrib="0" flow="0.00" speed="-1.00"/>
   <interval begin="120.00" end="131.00" id="D" nVehContrib="1" flow="99.00" speed="24.00"/>
</detector>"""
    counts = read_counts(file(text, "loops.xml"))
    assert vehicles(counts, "D") == [7, 0, 1]
    assert counts.frame["mean_speed_mps"].to_list() == [25.5, None, 24.0]
    assert counts.end_s == 131.0


def test_flows_and_vehicles(file):
    text = """<routes>
  <vType id="truck"/><route id="r" edges="a b"/>
  <flow id="f" begin="0" end="300" from="a" number="30"/>
  <flow id="g" begin="300" end="600" from="a" vehsPerHour="600"/>
  <flow id="h" begin="0" end="300" route="r" type="truck" number="4"/>
  <vehicle id="1" depart="5.0" type="truck"><route edges="c d"/></vehicle>
  <trip id="2" depart="299.0" from="c" to="d" type="truck"/>
  <vehicle id="3" depart="300.0" route="r" type="bus"/>
</routes>"""
    counts = read_counts(file(text, "a.rou.xml"))
    assert vehicles(counts, "a") == [30, 50]
    assert vehicles(counts, "a", "truck") == [4, 0]
    assert vehicles(counts, "a", "bus") == [0, 1]
    assert vehicles(counts, "c", "truck") == [2, 0]


def test_a_long_flow_keeps_its_number(file):
    text = '<routes><flow id="f" begin="0" end="10000" from="a" number="1001"/></routes>'
    counts = read_counts(file(text, "a.rou.xml"))
    assert sum(vehicles(counts, "a")) == 1001
    assert counts.interval_s <= 3600.0


@pytest.mark.parametrize(
    ("place", "row", "line"),
    [
        (
            3,
            "300,600,M,0,car,-3,24",
            "row 5: -3 vehicles; allowed are whole numbers from 0 on",
        ),
        (3, "300,600,M,0,car,12.5,24", "row 5: 12.5 vehicles; allowed are whole numbers"),
        (
            3,
            "300,600,M,0,car,abc,24",
            "row 5: vehicles is 'abc'; allowed is a finite number",
        ),
        (
            3,
            "300,600,M,0,car,nan,24",
            "row 5: vehicles is 'nan'; allowed is a finite number",
        ),
        (
            3,
            "300,600,M,x,car,12,24",
            "row 5: lane is 'x'; allowed are 0 (the rightmost) to 9",
        ),
        (
            3,
            "300,300,M,0,car,12,24",
            "row 5: the interval from 300 to 300 s is 0 s long; allowed are 60 to 3600 s",
        ),
        (
            3,
            "300,600,M,0,car",
            "row 5: has 5 values in a table of 7 columns; allowed are 7 values",
        ),
        (
            3,
            "0,300,M,0,car,100,24.5",
            "row 5: M lane 0, car at 0 s is there already, in row 2; allowed is once",
        ),
        (
            3,
            "0,300,M,0,car,101,24.5",
            (
                "row 5: M lane 0, car at 0 s is there already, in row 2 with other values; "
                "allowed is once"
            ),
        ),
        (
            3,
            "300,600,M,0,car,120,90",
            (
                "row 5: a mean speed of 90 m/s; allowed is up to 55 m/s; "
                "speeds in km/h belong into mean_speed_kmh"
            ),
        ),
        (
            3,
            "300,600,M,0,car,1400,24",
            (
                "row 5: 1412 vehicles in 300 s are 16944 veh/h; "
                "allowed are up to 2600 veh/h a lane; counts per hour belong into flow_veh_h"
            ),
        ),
        (
            5,
            "600,900,R,0,truck,1,15",
            "row 4: R lane 0 has no row from 300 to 600 s; allowed are files without gaps",
        ),
    ],
)
def test_what_does_not_add_up_is_told_by_row(file, place, row, line):
    assert told(file(table(*replaced(place, row)))) == [line]


def test_within_a_minute_a_platoon_may_pass(file):
    assert read_counts(file(table("0,60,M,0,car,60,24"))).interval_s == 60.0
    assert told(file(table("0,60,M,0,car,61,24"))) == [
        (
            "row 2: 61 vehicles in 60 s are 3660 veh/h; allowed are up to 3600 veh/h a lane; "
            "counts per hour belong into flow_veh_h"
        )
    ]


def test_a_gap_of_the_whole_file(file):
    rows = [row for row in ROWS if not row.startswith("300")]
    assert told(file(table(*rows))) == [
        "row 3: M lane 0 has no row from 300 to 600 s; allowed are files without gaps",
        "row 4: R lane 0 has no row from 300 to 600 s; allowed are files without gaps",
    ]


def test_a_decimal_comma(file):
    text = table("0;300;M;0;car;10;24,5", head=HEAD.replace(",", ";"))
    assert told(file(text)) == [
        (
            "row 2: mean_speed_mps is '24,5', with a decimal comma; "
            "allowed is a decimal point in every row"
        )
    ]
    counts = read_counts(file(text), repair=True)
    assert counts.frame["mean_speed_mps"].to_list() == [24.5]
    assert [repair.line("f") for repair in counts.repairs] == [
        ("f: row 2: mean_speed_mps is '24,5', with a decimal comma: taken as a point in every row")
    ]


@pytest.mark.parametrize("mark", [b"", codecs.BOM_UTF8])
def test_utf_8_may_have_its_mark(file, mark):
    assert read_counts(file(mark + table(*ROWS).encode())).detectors == ["M", "R"]


def test_other_encodings(file):
    text = table(*ROWS).replace(",M,", ",Süd,")
    assert told(file(text.encode("utf-16"))) == ["is encoded in UTF-16; allowed is UTF-8"]
    assert told(file(text.encode("latin-1"))) == [
        "row 2: is not UTF-8, perhaps Latin-1; allowed is UTF-8"
    ]
    for name in ("utf-16", "latin-1"):
        assert read_counts(file(text.encode(name)), repair=True).detectors == ["R", "Süd"]


def test_at_most_ten_lines(file):
    rows = [f"{60 * k},{60 * k + 60},M,0,car,-1,20" for k in range(25)]
    lines = told(file(table(*rows)))
    assert len(lines) == 11
    with pytest.raises(CorampError) as caught:
        read_counts(file(table(*rows)))
    assert caught.value.messages[-1] == "and 15 more"


@pytest.mark.parametrize(
    ("head", "line"),
    [
        ("begin_s,detector,vehicle", "column 'vehicle' is not known (did you mean vehicles?)"),
        ("begin_s,detector", "there is no column vehicles"),
        ("begin_s,time,detector,vehicles", "column begin_s is there twice; allowed is once"),
        (
            "begin_s,detector,vehicles,flow_veh_h",
            "has both vehicles and flow_veh_h; allowed is one of them",
        ),
    ],
)
def test_columns_that_are_not_right(file, head, line):
    (only,) = told(file(table("0,1,2,3", head=head)))
    assert only.startswith(f"row 1: {line}")


def stamped(day, hours, streams=("M",)):
    rows = [
        f"{day} {hour:02d}:{minute:02d},{stream},{hour}"
        for hour in hours
        for minute in (0, 15, 30, 45)
        for stream in streams
    ]
    return table(*rows, head="time,detector,vehicles")


def test_the_hour_that_daylight_saving_gives(file):
    path = file(stamped("2026-10-25", (1, 2, 2, 3)))
    assert told(path)[0] == (
        "row 10: the hour from 2026-10-25 02:00 comes twice, as where daylight saving ends; "
        "allowed are stamps with an offset, like +02:00"
    )
    counts = read_counts(path, repair=True)
    assert vehicles(counts) == [1] * 4 + [2] * 8 + [3] * 4
    assert counts.end_s == 4 * 3600.0


def test_the_hour_that_daylight_saving_takes(file):
    path = file(stamped("2026-03-29", (0, 1, 3, 4)))
    assert told(path)[0] == (
        "row 10: there is no hour from 2026-03-29 02:00, as where daylight saving begins; "
        "allowed are stamps with an offset, like +02:00"
    )
    counts = read_counts(path, repair=True)
    assert vehicles(counts) == [0] * 4 + [1] * 4 + [3] * 4 + [4] * 4


def test_offsets_know_no_daylight_saving(file):
    rows = [f"2026-03-29T{h:02d}:{m:02d}{o},M,1" for h, o in ((1, "+01:00"), (3, "+02:00"))
            for m in (0, 30)]  # fmt: skip
    counts = read_counts(file(table(*rows, head="time,detector,vehicles")))
    assert counts.frame["begin_s"].to_list() == [0.0, 1800.0, 3600.0, 5400.0]


def test_an_hour_missing_on_another_day_is_a_gap(file):
    path = file(stamped("2026-03-30", (0, 1, 3, 4)))
    assert told(path) == [
        "row 9: M has no row from 7200 to 10800 s; allowed are files without gaps"
    ]


@pytest.mark.parametrize(
    ("rows", "expected", "repair"),
    [
        (
            replaced(3, "300,600,M,0,car,-3,24"),
            [100, 95, 90],
            "row 5: -3 vehicles: taken as not counted",
        ),
        (
            replaced(3, "300,600,M,0,car,12.5,24"),
            [100, 12, 90],
            "row 5: 12.5 vehicles: taken as 12",
        ),
        (
            [*ROWS, ROWS[0]],
            [100, 120, 90],
            "row 11: M lane 0, car at 0 s is there already, in row 2: left out",
        ),
        (
            [row for row in ROWS if not row.startswith("300,600,M")],
            [100, 95, 90],
            (
                "row 3: M lane 0 has no row from 300 to 600 s: "
                "filled in from the counts before and behind"
            ),
        ),
    ],
)
def test_repairs_are_listed(file, rows, expected, repair):
    counts = read_counts(file(table(*rows)), repair=True)
    assert vehicles(counts) == expected
    assert [found.line("f") for found in counts.repairs] == [f"f: {repair}"]


def test_speeds_in_kmh_are_mended_for_the_whole_file(file):
    rows = ["0,300,M,0,car,10,108", "300,600,M,0,car,10,90", "600,900,M,0,car,10,36"]
    counts = read_counts(file(table(*rows)), repair=True)
    assert counts.frame["mean_speed_mps"].to_list() == [30.0, 25.0, 10.0]
    assert len(counts.repairs) == 1


def test_fractions_are_mended_without_losing_vehicles(file):
    rows = [f"{60 * k},{60 * k + 60},M,0,car,2.5,20" for k in range(8)]
    assert sum(vehicles(read_counts(file(table(*rows)), repair=True))) == 20


def test_fewer_downstream_than_upstream(file):
    rows = [f"{300 * k},{300 * k + 300},{d},{n}" for k in range(3)
            for d, n in (("M", 100), ("R", 20), ("D", 90))]  # fmt: skip
    path = file(table(*rows, head="begin_s,end_s,detector,vehicles"))
    assert read_counts(path).detectors == ["D", "M", "R"]
    asked = {"upstream": ("M", "R"), "downstream": "D"}
    assert told(path, **asked) == [
        (
            "row 7: up to 600 s D has 60 vehicles less than M and R upstream of it; "
            "allowed are up to 50 on the way"
        )
    ]
    mended = read_counts(path, repair=True, **asked)
    assert vehicles(mended, "D") == [90, 150, 90]
    assert told(path, upstream=("X",), downstream="D") == [
        "there is no detector 'X'; allowed are D, M, R"
    ]


@pytest.mark.parametrize("content", [b"", b"   \n", b"PAR1junk", b"<routes><flow id=", b"<a/>"])
def test_no_counts_at_all(file, content):
    path = file(content)
    with pytest.raises(CorampError) as caught:
        read_counts(path)
    (line,) = caught.value.messages
    assert line.startswith(f"{path}: ")
    assert "allowed" in line


def test_no_file(tmp_path):
    assert told(tmp_path / "none.csv")[0].startswith("cannot be read: No such file")


def test_a_row_that_lies_years_away_is_one_gap(file):
    rows = ["0,300,M,0,car,1,20", "300,600,M,0,car,1,20", "3e15,3000000000000300,M,0,car,1,20"]
    assert told(file(table(*rows))) == [
        "row 4: no detector has a row from 600 to 3e+15 s; allowed are files without gaps"
    ]


def test_more_than_a_lane_carries_even_in_a_short_last_interval(file):
    rows = ["0,300,M,0,car,1,20", "300,330,M,0,car,99999999999999999999,20"]
    assert told(file(table(*rows)), repair=True)[0].startswith("row 3: 1e+20 vehicles in 30 s")


@pytest.mark.parametrize(
    ("word", "taken"),
    [
        ("1.234,0", 1234),
        ("1'234", 1234),
        ("1\u2019234", 1234),
        ("1\u00a0234", 1234),
        ("1 234", 1234),
    ],
)
def test_thousands_separators_of_spreadsheets(file, word, taken):
    path = file(f"begin_s;end_s;detector;vehicles\n0;3600;M;{word}\n3600;7200;M;10\n")
    (line,) = told(path)
    assert line.startswith(
        f"row 2: vehicles is {word!r}, with a thousands separator; allowed is 1234"
    )
    assert vehicles(read_counts(path, repair=True)) == [taken, 10]


@pytest.mark.parametrize("word", ["1,234", "1.234"])
def test_what_may_be_thousands_or_decimals_is_never_guessed(file, word):
    path = file(f"begin_s;end_s;detector;vehicles\n0;3600;M;{word}\n3600;7200;M;10\n")
    line = (
        f"row 2: vehicles is {word!r}, with a thousands separator or decimals; "
        "allowed is a number without thousands separators and decimal commas"
    )
    assert told(path) == told(path, repair=True) == [line]


def test_decimal_commas_and_kmh_are_told_once_a_file(file):
    head = HEAD.replace(",", ";")
    rows = [f"{300 * k};{300 * k + 300};M;0;car;10;24,{k}" for k in range(12)]
    path = file(table(*rows, head=head))
    assert len(told(path)) == 1
    assert len(read_counts(path, repair=True).repairs) == 1
    rows = [f"{300 * k},{300 * k + 300},M,0,car,10,9{k % 9}" for k in range(12)]
    assert told(file(table(*rows))) == [
        (
            "row 2: a mean speed of 90 m/s; allowed is up to 55 m/s; "
            "speeds in km/h belong into mean_speed_kmh"
        )
    ]


def test_vehicles_of_an_interval_as_an_hourly_flow(file):
    rows = [f"{300 * k},{300 * k + 300},M,{n}" for k, n in enumerate((20, 25, 24, 31))]
    path = file(table(*rows, head="begin_s,end_s,detector,flow_veh_h"))
    assert told(path) == [
        (
            "row 2: 20 veh/h are 1.66667 vehicles in 300 s; allowed are whole numbers of vehicles "
            "in every row; counts of an interval belong into the column vehicles"
        )
    ]
    assert vehicles(read_counts(path, repair=True)) == [2, 2, 2, 2]  # of 1.67, 2.08, 2, 2.58


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"PK\x03\x04rest", "is a spreadsheet or packed (zip); "),
        (b"\x1f\x8b\x08rest", "is packed (gzip); "),
        (b"time,detector,vehicles\n0,M\x00,1\n", "row 2: byte 0x00 is no text; "),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "row 2: byte 0x1a is no text; "),
        ("time,detector\n".encode("utf-16-le"), "is encoded in UTF-16 without its mark; "),
        (b'<?xml version="1.0" encoding="none"?><routes/>', "row 1: unknown encoding: none; "),
    ],
)
def test_what_is_no_text_is_one_line(file, content, line):
    first, *others = told(file(content))
    assert first.startswith(line)
    assert "allowed is " in first
    assert not others or "UTF-16" in first


def test_any_line_end_and_the_row_that_names_the_separator(file):
    plain = read_counts(file(table(*ROWS))).frame
    for end in ("\r", "\r\n"):
        assert read_counts(file(table(*ROWS).replace("\n", end).encode())).frame.equals(plain)
    text = "sep=;\n" + table(*ROWS).replace(",", ";")
    assert read_counts(file(text)).frame.equals(plain)
    unmarked = read_counts(file(table(*ROWS).encode("utf-16-le")), repair=True)
    assert unmarked.frame.equals(plain)


def test_days_of_a_spreadsheet_are_no_seconds(file):
    rows = ("46153.2916666667,M,1", "46153.2951388889,M,2")
    (line,) = told(file(table(*rows, head="time,detector,vehicles")))
    assert line.startswith("row 2: time is '46153.2916666667', a spreadsheet's number of days; ")


def test_times_without_a_date_over_midnight(file):
    rows = [
        f"{time},{name},{k}" for name in "MR" for k, time in enumerate(("23:50", "23:55", "00:00"))
    ]
    path = file(table(*rows, head="time,detector,vehicles"))
    assert told(path) == [
        "row 4: time 00:00 comes after 23:55, as behind midnight; allowed are stamps with a date"
    ]
    counts = read_counts(path, repair=True)
    assert vehicles(counts) == vehicles(counts, "R") == [0, 1, 2]
    assert (counts.begin_s, counts.end_s) == (0.0, 900.0)


@pytest.mark.parametrize("values", [[[1], [2]], [{"a": 1}, {"a": 2}], [True, False], [b"1", b"2"]])
def test_parquet_with_columns_that_are_no_numbers(tmp_path, values):
    frame = pl.DataFrame({"time": [0, 300], "detector": ["M", "M"], "vehicles": values})
    frame.write_parquet(tmp_path / "a.parquet")
    (line,) = told(tmp_path / "a.parquet")
    assert line.startswith("column vehicles is of type ")
    assert line.endswith("; allowed are numbers, text, dates and times")


def flow(**values):
    given = {"id": "f", "begin": "0", "end": "300", "from": "a", "number": "30", **values}
    return "<routes><flow " + " ".join(f'{k}="{v}"' for k, v in given.items() if v) + "/></routes>"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (flow(end=""), "row 1: end is missing; allowed is a finite number"),
        (flow(begin="soon"), "row 1: begin is 'soon'; allowed is a finite number"),
        (flow(end="1e300"), "row 1: end is 1e+300 s; allowed is 0 to 2678400 s"),
        (
            flow(number=""),
            "row 1: the flow has no number; allowed are number, vehsPerHour or period",
        ),
        (
            '<routes><trip id="1" depart="1e300" from="a" to="b"/></routes>',
            "row 1: depart is 1e+300 s; allowed is 0 to 2678400 s",
        ),
        (
            '<routes><trip id="1" depart="triggered" from="a" to="b"/></routes>',
            "row 1: depart is 'triggered'; allowed is a finite number",
        ),
        (
            '<detector><interval begin="0" end="300" nVehContrib="7"/></detector>',
            "row 1: the interval has no id; allowed is that of its loop",
        ),
    ],
)
def test_sumo_s_files_that_cannot_be(file, text, line):
    assert told(file(text, "a.xml")) == [line]


def test_sumo_s_times_with_colons_and_files_in_utf_16(file):
    text = flow(begin="0:00:00", end="0:05:00")
    assert read_counts(file(text, "a.xml")).end_s == 300.0
    head = '<?xml version="1.0" encoding="utf-16"?>'
    assert vehicles(read_counts(file((head + text).encode("utf-16"), "b.xml")), "a") == [30]
