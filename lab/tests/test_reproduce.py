"""What a reproduction is made of: cells, options, recordings, and all of the paper."""

import re
from dataclasses import replace

import pytest

from pretouch.errors import ExperimentError, SkinError
from pretouch.sensing.skin import PAPER_SKIN
from pretouch_lab import experiment as lab_experiment
from pretouch_lab.cli.reproducing import compared, whole_paper
from pretouch_lab.experiment import NAMES, arguments, controllers, experiment, play, recording_file
from pretouch_lab.experiments import static
from pretouch_lab.options import TrialOptions
from pretouch_lab.run import open_run


def test_cells_are_all_values_for_each_controller_in_its_modes_that_the_experiment_is_about():
    options, sensing = (
        TrialOptions(profiles=("blind", "paper", "pretouch")),
        [("paper", "slack"), ("pretouch", "braking")],
    )
    hands = [tuple(each.values()) for each in experiment("avoidance").cells(options)]
    assert hands == [(place, *own) for place in ("beside", "inside") for own in (("blind", "off"), *sensing)]
    odd = TrialOptions(profiles=("blind", "paper", "paper:approach.rows=floor"), restrictions=("slack", "hard"))
    modes = [("blind", "off"), ("paper", "slack"), ("paper", "hard"), ("paper:approach.rows=floor", "floor")]
    assert [tuple(cell.values()) for cell in controllers(odd, "off")] == modes


def test_plays_are_all_cells_seed_by_seed_and_their_recordings_differ(tmp_path):
    odd = ("blind", "paper", "paper:approach.beta=-10", "paper:window.alpha=0.3", "paper:approach.slack_weight=1e+3")
    for name in NAMES:
        plays = experiment(name).plays(TrialOptions(2, 3, odd, ("off", "hard"), (2e3, 25e3)))
        assert [seed for _, seed in plays] == [3] * (len(plays) // 2) + [4] * (len(plays) // 2)
        files = {recording_file(tmp_path, *each).name for each in plays}
        assert len(files) == len(plays)
        assert all(re.fullmatch(r"[A-Za-z0-9._+-]+", file) for file in files)


def test_the_whole_paper_runs_every_experiment_and_no_trial_twice():
    parts = [(name, options) for _, name, options in whole_paper(TrialOptions(2))]
    plays = [(name, str(cell), seed) for name, options in parts for cell, seed in experiment(name).plays(options)]
    assert len(plays) == len(set(plays))
    assert {name for name, _, _ in plays} == set(NAMES)
    parts = whole_paper(TrialOptions(1, profiles=("paper",), restrictions=("slack",), stiffness=(2e3,)))
    assert len({where for where, _, _ in parts}) == len(parts)
    cells = [cell for _, name, options in parts if name == "static" for cell in static.cells(options)]
    assert [tuple(cell.values())[2:] for cell in cells] == [(2e3, "paper", "slack")] * 4


def test_arms_and_skins_are_parts_of_their_own():
    (alone,) = compared("avoidance", TrialOptions(arm="fr3"))
    assert (alone[0], alone[2].arm) == ("", "fr3")
    parts = compared("avoidance", TrialOptions(arm=",made/ur5e", skin=",made/skin.toml"))
    assert [(where, own.arm, own.skin) for where, _, own in parts] == [
        ("panda-own", "", ""),
        ("panda-skin", "", "made/skin.toml"),
        ("ur5e-own", "made/ur5e", ""),
        ("ur5e-skin", "made/ur5e", "made/skin.toml"),
    ]


@pytest.mark.parametrize("own", [True, False])
def test_a_changed_skin_file_is_noticed(tmp_path, monkeypatch, own):
    file, out = tmp_path / "skin.toml", tmp_path / "out"
    file.write_bytes(PAPER_SKIN.read_bytes())
    monkeypatch.setattr(lab_experiment, "skin_file", lambda _arm, paper: file)
    options = TrialOptions(1, skin=str(file) if own else "")
    open_run(out, arguments("static", options))
    open_run(out, arguments("static", replace(options, seeds=2)))  # more of the same
    file.write_bytes(PAPER_SKIN.read_bytes().replace(b"-0.108", b"-0.109"))
    with pytest.raises(ExperimentError, match=r"holds a run with skin_sha256 = .*: give another --out"):
        open_run(out, arguments("static", options))
    file.unlink()
    with pytest.raises(SkinError, match="cannot be read: No such file"):
        arguments("static", options)


@pytest.mark.parametrize(("record", "kept"), [("first", [0]), ("all", [0, 1])])
def test_the_trials_that_are_wanted_are_recorded(tmp_path, monkeypatch, record, kept):
    def played(_cell, seed, context):
        if context.recording:
            context.recording.write_text(str(seed))
        return {"measured": seed}, None

    monkeypatch.setattr(static, "EXPERIMENT", replace(static.EXPERIMENT, trial=played))
    options = TrialOptions(2, record=record)
    cell = static.cells(options)[0]
    (tmp_path / "recordings").mkdir()
    recording_file(tmp_path, cell, 0).with_suffix(".unfinished").write_text("of a killed worker")
    assert [play("static", options, tmp_path, cell, seed)["measured"] for seed in (0, 1)] == [0, 1]
    assert [seed for seed in (0, 1) if recording_file(tmp_path, cell, seed).exists()] == kept
    assert recording_file(tmp_path, cell, 0).read_text() == "0"
    assert len(list((tmp_path / "recordings").iterdir())) == len(kept)


def test_rows_of_a_world_say_it(tmp_path, monkeypatch):
    monkeypatch.setattr(static, "EXPERIMENT", replace(static.EXPERIMENT, trial=lambda *_: ({}, None)))
    rows = [play("static", TrialOptions(world=world), tmp_path, {"place": "here"}, 1) for world in ("", "stress")]
    assert rows == [{}, {"world": "stress"}]
