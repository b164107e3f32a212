import json
import re
import shlex
from dataclasses import replace

import pytest

from pretouch import cli
from pretouch.errors import ExperimentError
from pretouch_lab.bench import cycle
from pretouch_lab.cli.reproducing import new_folder
from pretouch_lab.experiments import static


def run(capsys, *args):
    code = cli.main(list(args))
    return code, capsys.readouterr()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("reproduce statik", "The experiment 'statik' is unknown: choose from static, avoidance, dynamic,"),
        ("reproduce static --profiles paper,brave", "The profile 'brave' is unknown"),
        ("reproduce static --profiles paper,paper", "The profiles are paper, paper: name at least one, and each once"),
        ("reproduce static --restrictions off,firm", "'firm' is unknown: choose from off, hard, slack, floor"),
        ("reproduce static --stiffness 25000,nan", "The stiffness is nan N/m"),
        ("reproduce static --skin /nowhere.toml", "/nowhere.toml cannot be read"),
        ("reproduce static --world strange", "not one of nominal, realistic, stress"),
        ("reproduce static --out OUT --json /dev/null/x.json", "/dev/null/x.json cannot be written"),
        (
            "reproduce static --out OUT --json OUT",
            "out is in .*out, where the run keeps its own: give a name that ends in .json",
        ),
        ("reproduce between --arm fr3", "'between' is laid out for the Panda: with --arm, choose static, avoidance"),
        ("demo --seeds 0", "The number of seeds is 0: give at least 1"),
        ("figure square", "The figure 'square' is unknown: choose from force-difference, circle"),
        ("figure circle --seed -1", "The seed is -1"),
        ("figure circle --out figure.jpg", "no known format: end its name in .png, .pdf, .svg"),
        ("figure circle --out /dev/null/x.png", "The figure /dev/null/x.png cannot be written .File exists.: give"),
        ("figure force-difference --profile blind", "cannot show blind, which has no proximity"),
        ("identify x.csv --arm nowhere", "nowhere"),
        ("bench cycle --points 7,0", "The numbers of points are 7, 0: give 1 to 10000"),
        ("bench cycle --rate 10", "The rate is 10 Hz"),
        ("bench cycle --rate nan", "The rate is nan Hz: give more than 20 and up to 10000 Hz"),
        ("bench cycle --cycles 0", "The number of cycles is 0"),
        ("bench cycle --priority 100", "The real-time priority is 100: give 1 to 99"),
        ("bench cycle --cpu -1", "Processor -1 is not available to this process: choose from"),
        ("bench calibration --skins 0", "The number of skins is 0"),
        ("bench avoidance --baselines nobody", "Baselines are blind, flacco"),
        ("bench avoidance --baselines pretouch:react.clam=no", "'react.clam' is unknown.* Baselines are blind"),
        ("sweep static", "Nothing is varied: give --vary"),
        ("sweep dance --vary a.b=1:2", "'dance' cannot be swept: choose from static, avoidance"),
        ("sweep static --vary detect.f_base_n", "detect.f_base_n has no value"),
        ("sweep static --vary slow=1:2 --vary slow=1:2", "names slow twice: write NAME=VALUE once"),
        ("sweep static --vary scene.place=1:2", "there is trajectory, side, stiffness_n_per_m"),
        ("sweep static --vary plant.ripple_nm=1:2", "cannot be used, as plant.ripple_nm is"),
        ("sweep static --vary detect.f_base_n=3:9", "than f_d_n.*The cell is .*narrow a range"),
        ("sweep static --vary skin.units=1,65", "units is 65: it must be at most 64"),
        ("sweep static --vary plant.kind=nominal,rusty", "plant.kind=rusty is unknown"),
        ("sweep static --vary window.alpha=0:1 --fix window.alpha=0.2", "window.alpha is both varied and fixed"),
        ("sweep static --vary window.alpha=0:1 --samples 100", "samples is 100: give a power of two, for example 64"),
        ("sweep static --vary window.alpha=0:1 --arms 0", "arms is 0: give 1 to 1000"),
        ("sweep static --vary window.alpha=0:1 --metrics force", "not measure 'force': choose from peak_estimate_n"),
        ("sweep static --vary window.alpha=0:1 --processes -1", "number of processes is -1"),
    ],
)
def test_bad_input_ends_with_one_sentence_and_code_2(capsys, tmp_path, monkeypatch, text, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pretouch_lab.run._played", None)  # what is not refused ends there
    code, said = run(capsys, *(str(tmp_path / "out") if arg == "OUT" else arg for arg in shlex.split(text)))
    assert code == 2
    assert re.search(words, said.err)
    assert said.err.count("\n") == 1
    assert said.out == ""
    assert {file.name for file in tmp_path.rglob("*.*")} <= {"run.json", "rows.jsonl"}


@pytest.mark.parametrize(
    ("command", "name"),
    [("reproduce static", "../link/run.json"), ("reproduce all", "tables.md"), ("bench shield", "rows.jsonl")],
)
def test_the_runs_own_files_are_not_overwritten(capsys, tmp_path, command, name):
    out = tmp_path / "out"
    (tmp_path / "link").symlink_to(out)
    code, text = run(capsys, *command.split(), "--out", str(out), "--json", str(out / name))
    assert code == 2
    assert "where the run keeps its own: give a name that ends in .json, but not run.json" in text.err
    assert text.err.count("\n") == 1
    assert not [each for each in out.rglob("*") if each.is_file()]


@pytest.mark.parametrize(("error", "code"), [(ExperimentError("full"), 2), (KeyboardInterrupt(), 130)])
def test_what_ends_a_run_is_said_with_how_far_it_came(capsys, tmp_path, monkeypatch, error, code):
    def play(cell, seed, _context):
        if cell["side"] == "+y":
            raise error
        return {}, None

    monkeypatch.setattr(static, "EXPERIMENT", replace(static.EXPERIMENT, trial=play))
    ended, text = run(capsys, "reproduce", "static", "--out", str(tmp_path), "--processes", "1")
    assert ended == code
    rows = tmp_path / "rows.jsonl"
    assert {2: "full\n", 130: f"Stopped: 2 of 96 rows are in {rows}; the same command with --out"}[code] in text.err
    assert len(rows.read_text().splitlines()) == 2


@pytest.mark.slow
def test_a_run_writes_what_it_says(capsys, tmp_path):
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    args = ("reproduce", "static", "--seeds", "1", "--out", str(out), "--json", str(numbers))
    code, text = run(capsys, *args)
    assert code == 0
    for words in ("Static object", "25 N/mm", "Times smaller", str(out / "tables.md"), str(numbers)):
        assert words in text.out
    tables = (out / "tables.md").read_text()
    assert len(re.findall("^## ", tables, flags=re.MULTILINE)) == 2
    assert re.findall(r"^!\[.+\]\((.+)\)$", tables, flags=re.MULTILINE) == ["static.png"]
    assert (out / "static.png").exists()
    results = json.loads(numbers.read_text())
    assert len(results["rows"]) == len((out / "rows.jsonl").read_text().splitlines()) == 8
    assert [len(table["rows"]) for table in results["tables"]] == [2, 1]
    assert max(len(line) for line in text.out.splitlines() if str(tmp_path) not in line) <= 80
    (out / "recordings" / next((out / "recordings").iterdir()).name).write_bytes(b"damaged")
    assert run(capsys, *args)[0] == 0, "the figure is left out"
    code, text = run(capsys, *args[:-4], "--out", str(out), "--stiffness", "2000")
    assert code == 2
    assert "holds a run with stiffness = [25000.0], not [2000.0]" in text.err


def test_a_new_demo_gets_a_new_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "demo-1").mkdir(parents=True)
    assert str(new_folder("demo")) == "runs/demo-2"


def test_bench_cycle_shows_and_writes_what_it_measured(capsys, tmp_path, monkeypatch):
    measure = cycle.measure

    def measured(points, request, tell):
        tell("No priority.")
        return measure(points, request, tell)

    monkeypatch.setattr(cycle, "measure", measured)
    file, quick = tmp_path / "cycle.json", ("--cycles", "20", "--rate", "100")
    code, said = run(capsys, "bench", "cycle", "--points", "3", *quick, "--json", str(file))
    assert code == 0
    for words in ("Time of a control step, 20 cycles [us]", "wall at 100 Hz", "overruns", "No priority."):
        assert words in said.out
    assert max(len(line) for line in said.out.splitlines() if str(tmp_path) not in line) <= 80
    about, (row,) = json.loads(file.read_text()).values()
    assert (about["rate_hz"], about["asked"], about["missing"]) == (100, [3], ["No priority."])
    assert about["versions"]["numba"]
    assert (row["points"], row["cycles"], row["tracking"]) == (3, 20, 1.0)
    for kind in ("", "wall_"):
        spread = [row[f"{kind}{name}_us"] for name in ("median", "p99", "p999", "max")]
        assert spread[0] > 0.0
        assert spread == sorted(spread)
