import csv
import json
from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch import cli
from pretouch.errors import ExperimentError
from pretouch.profiles import profile
from pretouch_lab import sweep as sweeps
from pretouch_lab.bench.dense_skin import UNITS, units_of
from pretouch_lab.domain_randomisation import drawn, named_set, world_set
from pretouch_lab.experiments import dynamic, static
from pretouch_lab.options import SweepOptions
from pretouch_lab.sweep import (
    UnitCount,
    dimension,
    results_of,
    setting,
    skin_of,
    sobol_indices,
    sweep_of,
    tables,
    trial,
)

X = {"plant.mass_error": "0:1", "plant.friction_compensated": "0:1", "sensing.reflectance": "0:1"}
A, B, PI4 = 7.0, 0.1, np.pi**4
V1, V2, V13 = 0.5 * (1 + B * PI4 / 5) ** 2, A**2 / 8, B**2 * PI4**2 * (1 / 18 - 1 / 50)
V = V1 + V2 + V13
FIRST, TOTAL = (V1 / V, V2 / V, 0.0), ((V1 + V13) / V, V2 / V, V13 / V)
"""Indices of Ishigami's function, in closed form (Ishigami and Homma 1990, Sobol and Levitan 1999)."""


def ishigami(cell):
    """f = sin x1 + A sin^2 x2 + B x3^4 sin x1, each x uniform from -pi to pi."""
    x1, x2, x3 = (np.pi * (2.0 * cell[name] - 1.0) for name in X)
    return float(np.sin(x1) + A * np.sin(x2) ** 2 + B * x3**4 * np.sin(x1))


def grid(arms):
    return SweepOptions("static", "grid", arms=arms)


def sobol(samples=4, arms=1, seeds="development"):
    return sweep_of(SweepOptions("static", samples=samples, arms=arms, seeds=seeds), X, {})


def indices(samples):
    sweep = sobol(samples)
    return sobol_indices(sweep.columns, [ishigami(cell) for cell, _ in sweep.plays()])


def test_a_grid_plays_each_combination_with_the_same_arms():
    sweep = sweep_of(grid(4), {"detect.f_base_n": "7:20:3", "scene.side": "-y,+y"}, {})
    arms = {}
    for cell, seed in sweep.plays():
        arms.setdefault(tuple(cell.values()), []).append(seed)
    assert list(arms) == [(force, side) for force in (7.0, 13.5, 20.0) for side in ("-y", "+y")]
    assert list(arms.values()) == [[1000, 1001, 1002, 1003]] * 6


def test_blocks_for_sobol_indices_differ_in_one_column_at_a_time_and_more_samples_begin_with_the_same():
    sweep = sobol(4, arms=8)
    rows, wide = [[*cell.values(), seed] for cell, seed in sweep.plays()], len(sweep.columns)
    assert len(rows) == 4 * (wide + 2)
    for block in range(4):
        first, *each, last = rows[block * (wide + 2) :][: wide + 2]
        for column, row in enumerate(each):
            assert row == [*first[:column], last[column], *first[column + 1 :]]
    few, many = sobol(4).plays(), sobol(8).plays()
    assert sobol(4).plays() == few == many[: len(few)]
    development, published = (
        [seed for _, seed in sobol(4, 8, seeds).plays()] for seeds in ("development", "published")
    )
    assert min(development) >= 1000 > max(published)


@pytest.mark.slow
def test_the_indices_of_a_function_in_closed_form_whose_intervals_shrink_with_more_samples():
    few, many = indices(64), indices(1024)
    assert [row["parameter"] for row in many] == list(X)
    np.testing.assert_allclose([row["first"] for row in many], FIRST, atol=0.03)
    np.testing.assert_allclose([row["total"] for row in many], TOTAL, atol=0.03)
    for row, fewer, first, total in zip(many, few, FIRST, TOTAL, strict=True):
        assert abs(row["first"] - first) < 2 * row["first_95"]
        assert abs(row["total"] - total) < 2 * row["total_95"]
        assert 0.0 < row["total_95"] < 0.12
        assert fewer["total_95"] > 2 * row["total_95"]


def test_a_block_with_a_missing_value_is_left_out_whole_and_counted_and_what_does_not_vary_has_no_indices():
    sweep = sobol(512)
    some = [ishigami(cell) for cell, _ in sweep.plays()]
    some[3] = some[4] = some[100] = None
    for row, total in zip(sobol_indices(sweep.columns, some), TOTAL, strict=True):
        assert (row["blocks"], row["of"]) == (510, 512)
        assert abs(row["total"] - total) < 2 * row["total_95"]
    for value in (None, 3.0):
        assert [row["total"] for row in sobol_indices(sweep.columns, [value] * len(some))] == [None] * 3


def test_the_course_over_a_grid():
    sweep = sweep_of(grid(2), X | {"plant.mass_error": "0:1:3"}, {})
    rows = [cell | {"seed": seed, "value": ishigami(cell)} for cell, seed in sweep.plays()]
    found = results_of(sweep, rows, ["value"])
    middle = [row["value"]["median"] for row in found["plant.mass_error"]]
    assert middle == pytest.approx([0.0, 0.0, 0.0])  # sin x1 is 0, and x2 is thrice at a root of the sine
    shown = tables(sweep, found, ["value"])
    assert [(table.header[0], len(table.rows)) for table in shown] == [
        (name, n) for name, n in zip(X, (3, 5, 5), strict=True)
    ]


@pytest.mark.parametrize(("name", "of"), [("static", static), ("dynamic", dynamic)])
def test_a_cell_is_a_trial_of_the_experiment(name, of, context):
    row = trial(name, "paper:approach=none", {}, 1001)
    where = asdict(sweeps.EXPERIMENTS[name].scene) | {"profile": "paper:approach=none"}
    own, _ = of.trial(where, 1001, context)
    shared = [metric for metric in sweeps.EXPERIMENTS[name].metrics if metric != "missed"]
    assert row == {"failed": "", "missed": row["missed"], **{metric: own[metric] for metric in shared}}
    detected = [each["detected"] for each in own.get("contacts", [{"detected": own["detection_delay_s"] is not None}])]
    assert row["missed"] == 1.0 - np.mean(detected)


def test_a_cell_that_cannot_be_played_has_the_reason_in_its_row(monkeypatch):
    assert "plant.kind=rusty" in trial("static", "paper", {"plant.kind": "rusty"}, 0)["failed"]
    monkeypatch.setattr(sweeps, "experiment", lambda name: 1 / 0)
    row = trial("static", "paper", {}, 0)
    assert row["failed"] == "ZeroDivisionError: division by zero"
    assert row["true_peak_n"] is None


def test_each_value_arrives_where_its_name_says():
    values = {
        "detect.f_base_n": 8.25, "detect.f_std_n": 1 / 3 + 1e-9, "approach.rows": "floor", "slow": "none",
        "plant.mass_error": 0.1, "plant.kind": "payload", "sensing.latency_s": 0.1, "sensing.rate_hz": 10,
        "skin.units": 3, "scene.side": "+y",
    }  # fmt: skip
    cell, context = setting("static", "paper", values, 1003)
    own = profile(cell["profile"])
    assert (own.detect.f_base_n, own.detect.f_std_n, own.approach.rows, own.slow) == (8.25, 1 / 3 + 1e-9, "floor", None)
    assert (context.plant.mass_error, context.plant.payload_max_kg) == (0.1, 0.5)
    assert (context.ranging.latency_s, context.ranging.rate_hz) == (0.1, 10.0)
    assert (len(context.skin), cell["side"], cell["trajectory"]) == (3, "+y", "circle")


def test_a_world_draws_arm_and_sensors_under_what_is_varied():
    one, other = ({"plant.world": "realistic"} | more for more in ({"plant.payload_max_kg": 0.3}, {}))
    made = setting("static", "paper", one, 1003)[1]
    world = drawn(world_set("realistic"), 1003)
    assert (made.plant, made.ranging) == (replace(world.plant, payload_max_kg=0.3), world.ranging)
    assert setting("static", "paper", other, 1004)[1].plant.torque_offset_nm != made.plant.torque_offset_nm


def test_more_units_are_those_of_fewer_and_others():
    counts = [units_of(n) for n in range(65)]
    assert counts[32] == UNITS
    assert counts[1]["hand"] == 1
    for n, (fewer, more) in enumerate(pairwise(counts)):
        assert sum(fewer.values()) == n
        assert all(more[name] >= fewer[name] for name in UNITS)
    few, many = skin_of(UnitCount(3)), skin_of(UnitCount(64))
    places = {unit.id: unit.T_link_sensor.tolist() for unit in many.units}
    assert len(places) == 64
    assert all(places[unit.id] == unit.T_link_sensor.tolist() for unit in few.units)


@pytest.mark.parametrize(
    ("text", "now", "values"),
    [
        ("2:20:4", 1.0, [2.0, 8.0, 14.0, 20.0]),
        ("1:100:log:3", 1.0, [1.0, 10.0, 100.0]),
        ("1:64:log:7", 3, [1, 2, 4, 8, 16, 32, 64]),
        ("1:3:9", 3, [1, 2, 3]),
        ("4,2.5, 8", 1.0, [4, 2.5, 8]),
        ("slack,floor", "off", ["slack", "floor"]),
    ],
)
def test_a_grid_takes_these_values(text, now, values):
    grid = dimension("a.b", text, now).grid()
    assert grid == (values if isinstance(values[0], str) else pytest.approx(values))
    assert [type(value) for value in grid] == [type(value) for value in values]


@pytest.mark.parametrize(
    ("text", "now"),
    [("20:2", 1.0), ("0:2:log", 1.0), ("1:2:lag", 1.0), ("1:2:1", 1.0), ("1:b", 1.0), ("1:nan", 1.0), ("1:2.5", 3),
     ("a:b", "off"), ("0:1", True), ("1:", 1.0)],
)  # fmt: skip
def test_a_range_that_cannot_be_used_is_named_with_the_way_out(text, now):
    with pytest.raises(ExperimentError, match=f"a.b={text} cannot be used, as a.b is {now}: write NAME=LOW:HIGH"):
        dimension("a.b", text, now)


@given(part=st.floats(0.0, 1.0), log=st.booleans(), whole=st.booleans())
def test_every_part_of_a_range_lies_in_it(part, log, whole):
    one = dimension("a.b", "1:64:log" if log else "1:64", 1 if whole else 1.0)
    assert 1 <= one.at(part) <= 64
    assert isinstance(one.at(part), int) == whole
    assert (one.at(0.0), one.at(1.0)) == (1, 64)


def test_each_choice_and_each_whole_number_has_as_much_of_the_range():
    parts = [(i + 0.5) / 600 for i in range(600)]
    choices, whole = dimension("a.b", "x,y,z", "x"), dimension("a.b", "1:4", 1)
    assert [sum(choices.at(p) == v for p in parts) for v in "xyz"] == [200, 200, 200]
    assert [sum(whole.at(p) == v for p in parts) for v in (1, 2, 3, 4)] == [150, 150, 150, 150]
    assert dimension("a.b", "0.01:1:log", 1.0).at(0.5) == pytest.approx(0.1)


def test_a_sweep_shows_and_writes_what_it_found_and_is_not_played_twice(capsys, tmp_path, monkeypatch):
    numbers = ("failed", *sweeps.EXPERIMENTS["static"].metrics)
    monkeypatch.setattr(
        sweeps, "trial", lambda name, text, cell, seed: dict.fromkeys(numbers, ishigami(cell)) | {"failed": ""}
    )
    vary = [word for name, text in X.items() for word in ("--vary", f"{name}={text}")]
    args = ["sweep", "static", *vary, "--arms", "1", "--metrics", "true_peak_n", "--processes", "1"]
    args += ["--out", str(tmp_path)]
    assert cli.main([*args, "--samples", "4", "--json", str(tmp_path / "numbers.json")]) == 0
    assert "4 of 4 blocks have a value" in capsys.readouterr().out
    assert (tmp_path / "static.png").stat().st_size > 1000
    rows = list(csv.DictReader((tmp_path / "static.csv").read_text().splitlines()))
    assert len(rows) == 20
    assert all(float(row["true_peak_n"]) == ishigami({name: float(row[name]) for name in X}) for row in rows)
    assert [
        row["parameter"] for row in json.loads((tmp_path / "numbers.json").read_text())["results"]["true_peak_n"]
    ] == list(X)
    assert cli.main([*args, "--samples", "8"]) == 0
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 40, "only new cells are played"


def test_a_folder_is_not_taken_up_with_another_file_of_a_world(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(
        sweeps, "trial", lambda *_: {"failed": "", **dict.fromkeys(sweeps.EXPERIMENTS["static"].metrics)}
    )
    place = tmp_path / "arm.toml"
    args = ["sweep", "static", "--vary", "detect.f_base_n=7,8", "--fix", f"plant.world={place}", "--design", "grid"]
    args += ["--arms", "1", "--processes", "1", "--out", str(tmp_path / "out")]
    place.write_text("[plant]\npayload_max_kg = 0.25\n")
    assert cli.main(args) == 0
    place.write_text("[plant]\npayload_max_kg = 0.3\n")
    named_set.cache_clear()
    assert cli.main(args) == 2
    assert "holds a run with worlds_sha256 = " in capsys.readouterr().err
