import json

import pytest

from pretouch import cli
from pretouch.atomic_write import write_json
from pretouch.errors import ExperimentError
from pretouch_lab.cli import bench_cycle
from pretouch_lab.cli.commands import new_folder


def run(capsys, *args):
    code = cli.main(list(args))
    return code, capsys.readouterr()


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("reproduce", "static", "--profiles", "paper,brave"), "The profile 'brave' is unknown"),
        (("reproduce", "static", "--stiffness", "25,soft"), "The stiffness is 'soft': give numbers in N/m"),
        (("reproduce", "static", "--profiles", "paper:react.decay=3"), "The parameter 'react.decay' is unknown"),
        (("reproduce", "static", "--skin", "/nowhere.toml"), "/nowhere.toml cannot be read"),
        (("reproduce", "static", "--out", "OUT", "--json", "/dev/null/x.json"), "/dev/null/x.json cannot be written"),
        (("reproduce", "static", "--out", "OUT", "--json", "OUT"), "written (Is a directory): give another file"),
        (("reproduce", "static", "--out", "OUT", "--json", "x" * 256), "written (File name too long): give another"),
        (("demo", "--seeds", "0"), "The number of seeds is 0"),
        (("bench", "cycle", "--points", "7,x"), "The numbers of points are '7,x': give whole numbers"),
        (("bench", "cycle", "--points", ""), "The numbers of points are '': give whole numbers"),
        (("bench", "cycle", "--points", "7,0"), "The number of points is 0: give 1 to 10000"),
        (("bench", "cycle", "--rate", "10"), "The rate is 10 Hz"),
        (("bench", "cycle", "--rate", "nan"), "The rate is nan Hz: give more than 20 and up to 10000 Hz"),
        (("bench", "cycle", "--cycles", "0"), "The number of cycles is 0"),
        (("bench", "cycle", "--profile", "brave"), "The profile 'brave' is unknown"),
        (("bench", "cycle", "--priority", "100"), "The real-time priority is 100: give 1 to 99"),
        (("bench", "cycle", "--cpu", "-1"), "Processor -1 is none this process may use: choose from"),
        (("bench", "cycle", "--json", "/dev/null/x.json"), "/dev/null/x.json cannot be written"),
        (("reproduce", "static", "--record", "some"), "The choice of trials to record 'some' is unknown"),
        (("reproduce", "static", "--world", "strange"), "not one of nominal, realistic, stress"),
        (("bench", "detection", "--out", "OUT", "--world", "strange"), "not one of nominal, realistic, stress"),
        (("bench", "calibration", "--skins", "0"), "The number of skins is 0"),
        (("bench", "calibration", "--seed", "-1"), "The seed is -1: it must be at least 0."),
    ],
)
def test_bad_input_ends_with_one_sentence_and_code_2(capsys, tmp_path, args, words):
    code, said = run(capsys, *(str(tmp_path / "out") if arg == "OUT" else arg for arg in args))
    assert code == 2
    assert words in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


@pytest.mark.parametrize("name", ["run.json", "trials/x.json", "recordings/a/b.json", "trials", "../link/run.json"])
def test_the_runs_own_files_are_not_overwritten(capsys, tmp_path, name):
    out = tmp_path / "out"
    (tmp_path / "link").symlink_to(out)
    code, said = run(capsys, "reproduce", "static", "--out", str(out), "--json", str(out / name))
    assert code == 2
    assert "would take the place of the run's own" in said.err
    assert said.err.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize("error", [RuntimeError("crash"), ExperimentError("full"), KeyboardInterrupt()])
def test_finished_trials_are_kept_whatever_ends_a_run(capsys, tmp_path, monkeypatch, error):
    def play(tasks, _out, _progress):
        tasks[0].file.parent.mkdir(parents=True, exist_ok=True)
        write_json(tasks[0].about, tasks[0].file)
        raise error

    monkeypatch.setattr("pretouch_lab.cli.campaigns.run_tasks", play)
    monkeypatch.setattr("pretouch_lab.cli.campaigns.summarise", len)
    args = ("reproduce", "static", "--out", str(tmp_path))
    if isinstance(error, RuntimeError):
        with pytest.raises(RuntimeError, match="crash"):
            cli.main(list(args))
    else:
        code, said = run(capsys, *args)
        assert code == (2 if isinstance(error, ExperimentError) else 130)
        assert "full\n" in said.err or "the 1 finished trials are in" in said.err
    assert len(json.loads((tmp_path / "results.json").read_text())["trials"]) == 1


def test_results_that_cannot_be_written_at_the_end_are_said(capsys, tmp_path, monkeypatch):
    def full(_value, _path):
        raise OSError(28, "No space left on device")

    def play(_tasks, _out, _progress):
        monkeypatch.setattr("pretouch_lab.cli.campaigns.write_json", full)

    monkeypatch.setattr("pretouch_lab.cli.campaigns.run_tasks", play)
    code, said = run(capsys, "reproduce", "static", "--out", str(tmp_path))
    assert code == 2
    assert "results.json cannot be written (No space left on device)" in said.err


@pytest.mark.slow
def test_a_run_writes_what_it_says(capsys, tmp_path):
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    args = ("reproduce", "static", "--seeds", "1", "--out", str(out), "--json", str(numbers))
    code, said = run(capsys, *args)
    assert code == 0
    for words in ("Static object", "circle", "line", "ratio", str(out / "tables.md"), str(numbers)):
        assert words in said.out
    assert (out / "static.png").exists()
    results = json.loads(numbers.read_text())
    assert len(results["trials"]) == 8
    assert len(results["summary"]["static"]["cells"]) == 8
    ratios = results["summary"]["static"]["ratios"]
    assert [r["of"] for r in ratios] == ["blind/paper"] * 4
    assert all(r["peak_estimate_n"]["median"] > 1 for r in ratios)
    assert max(len(line) for line in said.out.splitlines() if str(tmp_path) not in line) <= 80
    code, said = run(capsys, *args[:-4], "--out", str(out), "--stiffness", "2000")
    assert code == 2
    assert "holds a run with stiffness = [25000.0], not [2000.0]" in said.err


def test_a_new_demo_gets_a_new_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "demo-1").mkdir(parents=True)
    assert str(new_folder("demo")) == "runs/demo-2"


def test_bench_cycle_shows_and_writes_what_it_measured_before_it_was_stopped(capsys, tmp_path, monkeypatch):
    measure = bench_cycle.measure

    def once(points, request, tell):
        if points == 5:
            raise KeyboardInterrupt
        tell("No priority.")
        return measure(points, request, tell)

    monkeypatch.setattr(bench_cycle, "measure", once)
    file, quick = tmp_path / "cycle.json", ("--cycles", "20", "--rate", "100")
    code, said = run(capsys, "bench", "cycle", "--points", "3,5", *quick, "--json", str(file))
    assert code == 130
    for words in ("Time of a control step, 20 cycles [us]", "wall at 100 Hz", "overruns", "No priority."):
        assert words in said.out
    assert max(len(line) for line in said.out.splitlines() if str(tmp_path) not in line) <= 80
    assert "Stopped: 1 of 2 numbers of points were measured." in said.err
    about, (row,) = json.loads(file.read_text()).values()
    assert (about["rate_hz"], about["asked"], about["missing"]) == (100, [3, 5], ["No priority."])
    assert about["versions"]["numba"]
    assert list(row)[:6] == ["points", "median_us", "p99_us", "p999_us", "max_us", "overruns"]
    assert row["points"] == 3
