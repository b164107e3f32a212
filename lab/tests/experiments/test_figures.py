from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from pretouch import cli
from pretouch.recording.run_record import MODES, RunRecord, TrueForces
from pretouch.types import Contact, Mode
from pretouch_lab.cli import reproducing
from pretouch_lab.cli.reproducing import draw_figure
from pretouch_lab.experiments import between, figures
from pretouch_lab.experiments.figures import circle, close_up, force_difference, interaction

S, UNITS = 400, tuple("abcdefg")
TOUCHED, DETECTED = slice(300, 320), 305


def made_trace() -> RunRecord:
    """Four seconds at rest at y = 0.2: an object at y = 0.6 from 1 s to 2 s, and a push of 20 N along +y at 3 s."""
    zeros = np.zeros((S, 3))
    points, ranges = np.full((S, 3), np.nan), np.full((S, 7), np.nan)
    points[100:200], ranges[100:200, 1] = [0.5, 0.6, 0.3], 0.3
    scale, true, reacting = np.ones(S), zeros.copy(), np.zeros(S, bool)
    scale[100:200], scale[200:250] = 0.5, 0.8
    true[TOUCHED, 1] = 20.0
    reacting[DETECTED:350] = True
    place = np.tile([0.5, 0.2, 0.3], (S, 1))
    thresholds = np.broadcast_to(np.array([8.0, -9.0, 0.0, 0.0, 1.0, 2.0])[:, None], (S, 6, 3))
    found = Contact(np.array([0.0, 20.0, 0.0]), np.array([False, True, False]))
    return RunRecord(
        time=0.01 * np.arange(S), mode=np.where(reacting, MODES.index(Mode.REACT), MODES.index(Mode.TRACK)),
        ee_position=place, ee_velocity=zeros, path_position=place, speed_scale=scale, range_distance=ranges,
        nearest_point=points, force=true, filtered_force=0.5 * true, thresholds=thresholds, armed=np.ones(S, bool),
        evidence=np.zeros(S), contacts=((DETECTED, found, 0.1),), truth=TrueForces(0.01 * np.arange(S), true),
    )  # fmt: skip


def traces(profile="paper", **changes):
    return [({"profile": profile}, replace(made_trace(), **changes))]


def line(axes, label):
    return next(found for found in axes.lines if found.get_label() == label)


def test_the_circle_tells_free_motion_avoidance_while_something_is_near_the_end_effector_and_recovery():
    # 0.4 m from the end-effector's origin
    assert figures.near(made_trace(), 0.41).nonzero()[0].tolist() == list(range(100, 200))
    assert not figures.near(made_trace(), 0.39).any()
    (plane, *_) = circle(traces(), UNITS).axes
    free, avoidance, recovery = (
        np.flatnonzero(np.isfinite(line(plane, name).get_xdata())).tolist()
        for name in ("free", "avoidance", "recovery")
    )
    assert (avoidance, recovery) == (list(range(100, 200)), list(range(200, 250)))
    assert free == [*range(100), *range(250, S)]
    objects = line(plane, "sensed objects")
    assert set(zip(objects.get_xdata(), objects.get_ydata(), strict=True)) == {(0.6, 0.3)}


def test_the_interaction_shades_slowed_and_touched_spans_and_a_close_up_without_a_touch_shows_all():
    top, middle, bottom = interaction(traces(), UNITS).axes
    for axes in (top, middle, bottom):
        spans = {patch.get_label(): (patch.get_x(), patch.get_width()) for patch in axes.patches}
        assert spans["slowed"] == pytest.approx((1.0, 1.5))
        assert spans["contact and reaction"] == pytest.approx((3.0, 0.5))
    assert [text.get_text() for text in middle.texts] == ["pushed +y"]
    assert line(top, "activation, d_max 0.8 m").get_ydata() == [0.8, 0.8]
    assert line(middle, "detected").get_xdata() == pytest.approx([3.05])
    assert close_up(traces(truth=None), UNITS).axes[1].get_xlim() == (0.0, 3.99)


def test_the_force_difference_counts_from_the_touch_away_from_the_object():
    sides, names = ("-y", "+y"), ("blind", "paper")
    cells = [{"trajectory": "circle", "side": side, "profile": name} for side in sides for name in names]
    along, against, *_ = force_difference([(cell, made_trace()) for cell in cells], UNITS).axes
    for axes, sign in ((along, 1.0), (against, -1.0)):
        estimate = line(axes, "blind: estimate")
        assert estimate.get_xdata()[300] == 0.0
        assert estimate.get_ydata()[300] == sign * 20.0
        assert line(axes, "paper: detected").get_xdata() == pytest.approx([0.05])
    assert force_difference([], UNITS).axes[0].lines[:] == []


def test_a_figure_is_written_here_by_its_name_of_trials_that_are_played_and_told(tmp_path, monkeypatch, capsys):
    played = []

    def play(cell, seed, _context):
        played.append((cell, seed))
        return {}, cell

    monkeypatch.setattr(between, "EXPERIMENT", replace(between.EXPERIMENT, trial=play))
    monkeypatch.setattr(reproducing, "trace_of", lambda _record: made_trace())
    monkeypatch.chdir(tmp_path)
    assert cli.main(["figure", "close-up", "--profile", "paper-0.5m", "--seed", "4"]) == 0
    text = capsys.readouterr()
    assert text.err == "Playing paper-0.5m, slack with seed 4.\n"
    assert text.out == "Figure: close-up.png\n"
    assert [path.name for path in tmp_path.iterdir()] == ["close-up.png"]
    assert played == [({"profile": "paper-0.5m", "restrictions": "slack"}, 4)]
    draw_figure("close-up", tmp_path / "x.svg")
    assert "<svg" in (tmp_path / "x.svg").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["circle", "interaction", "close-up", "force-difference"])
def test_each_figure_is_drawn_from_trials_it_plays(tmp_path, name):
    draw_figure(name, tmp_path / "x.png", seed=102)
    with Image.open(tmp_path / "x.png") as picture:
        assert np.asarray(picture.convert("L")).std() > 10


def test_figures_of_a_detector_without_thresholds_show_none():
    for figure in (draw(traces("pretouch"), UNITS) for draw in (interaction, close_up)):
        labels = [text for axes in figure.axes for text in axes.get_legend_handles_labels()[1]]
        assert "bands of one sample" in labels
        assert not {"thresholds", "thresholds without F_obs", "value of eq. 8"} & set(labels)
        force = next(axes for axes in figure.axes if "force" in axes.get_ylabel())
        assert line(force, "detected").get_ydata().tolist() == [20.0]
