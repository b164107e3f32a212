import json
import subprocess
import sys

import pytest

from pretouch import cli
from pretouch.errors import ExperimentError


def run(capsys, *args):
    code = cli.main(list(args))
    return code, capsys.readouterr()


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("reproduce", "statik"), "The experiment 'statik' is unknown"),
        (("reproduce", "static", "--profiles", "paper,brave"), "The profile 'brave' is unknown"),
        (("reproduce", "static", "--restrictions", "firm"), "The restriction mode 'firm' is unknown"),
        (("reproduce", "static", "--stiffness", "25,soft"), "The stiffness is 'soft': give numbers in N/m"),
        (("reproduce", "static", "--profiles", "paper:reaction.decay=3"), "The parameter 'reaction.decay' is unknown"),
        (("reproduce", "static", "--orientation", "up"), "The orientation 'up' is unknown: choose from free, hold"),
        (("reproduce", "static", "--seeds", "-1"), "The number of seeds is -1"),
        (("reproduce", "static", "--skin", "/nowhere.toml"), "/nowhere.toml cannot be read"),
        (("reproduce", "static", "--out", "/dev/null/x"), "/dev/null/x cannot be used"),
        (("reproduce", "static", "--out", "OUT", "--json", "/dev/null/x.json"), "/dev/null/x.json cannot be written"),
        (("reproduce", "static", "--out", "OUT", "--json", "OUT"), "cannot be written: Is a directory"),
        (("reproduce", "static", "--out", "OUT", "--json", "x" * 256), "cannot be written: File name too long"),
        (("demo", "--seeds", "0"), "The number of seeds is 0"),
    ],
)
def test_bad_input_ends_with_one_sentence_and_code_2(capsys, tmp_path, args, words):
    code, said = run(capsys, *(str(tmp_path / "out") if arg == "OUT" else arg for arg in args))
    assert code == 2
    assert words in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


@pytest.mark.parametrize("name", ["run.json", "trials/x.json", "traces/a/b.json", "trials", "../link/run.json"])
def test_the_runs_own_files_are_not_overwritten(capsys, tmp_path, name):
    out = tmp_path / "out"
    (tmp_path / "link").symlink_to(out)
    code, said = run(capsys, "reproduce", "static", "--out", str(out), "--json", str(out / name))
    assert code == 2
    assert "would take the place of the run's own" in said.err
    assert said.err.count("\n") == 1
    assert not out.exists()


def _row(request, out):
    from pretouch.experiments.campaign import trial_file, write_json

    cell, seed = request.tasks()[0]
    row = {"experiment": cell.experiment, **cell.where, "profile": cell.profile, "seed": seed}
    write_json(row, trial_file(out, cell, seed))


@pytest.mark.parametrize("error", [RuntimeError("crash"), ExperimentError("full"), KeyboardInterrupt()])
def test_finished_trials_are_kept_whatever_ends_a_run(capsys, tmp_path, monkeypatch, error):
    def play(request, out, _progress):
        _row(request, out)
        raise error

    monkeypatch.setattr("pretouch.cli.campaigns.run_campaign", play)
    monkeypatch.setattr("pretouch.cli.campaigns.summarise", len)
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

    def play(request, out, _progress):
        monkeypatch.setattr("pretouch.cli.campaigns.write_json", full)

    monkeypatch.setattr("pretouch.cli.campaigns.run_campaign", play)
    code, said = run(capsys, "reproduce", "static", "--out", str(tmp_path))
    assert code == 2
    assert "results.json cannot be written: No space left on device" in said.err


def test_help_needs_none_of_the_heavy_packages():
    heavy = ("numpy", "scipy", "numba", "mujoco", "matplotlib")
    code = f"import sys, pretouch.cli; sys.exit(', '.join(m for m in {heavy} if m in sys.modules) or 0)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_ctrl_c_while_words_are_read_ends_in_order(monkeypatch):
    def stop(*_args, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli.tyro, "cli", stop)
    assert cli.main(["demo"]) == 130


@pytest.mark.parametrize("args", [(), ("dance",), ("reproduce", "--seeds", "many"), ("demo", "--nothing")])
def test_words_it_does_not_know_end_with_code_2(capsys, args):
    with pytest.raises(SystemExit) as stop:
        cli.main(list(args))
    assert stop.value.code == 2


def test_help_names_the_commands(capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(["--help"])
    assert stop.value.code == 0
    said = capsys.readouterr().out
    assert "demo" in said
    assert "reproduce" in said


def test_a_run_writes_what_it_says(capsys, tmp_path):
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    args = ("reproduce", "static", "--seeds", "1", "--out", str(out), "--json", str(numbers))
    code, said = run(capsys, *args)
    assert code == 0
    for words in ("Static object", "circle", "line", "ratio", str(out / "index.html"), str(numbers)):
        assert words in said.out
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
    assert str(cli._new_folder("demo")) == "runs/demo-2"
