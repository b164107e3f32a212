from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.page.plots import FORCE_N, SAMPLE_S, SAMPLES, SPAN_S, History, Plots
from pretouch.types import Thresholds

K = 7


def test_a_history_holds_the_last_seconds_and_no_more(some_step):
    history = History(np.arange(K))
    for i in range(6000):
        history.add(replace(some_step, stamp=i / 100))
    time = history.column("time")
    assert len(time) <= SAMPLES + 1
    assert time[-1] == pytest.approx(59.99, abs=0.1)
    assert SPAN_S - 0.2 <= time[-1] - time[0] <= SPAN_S + 0.2
    assert np.all(np.diff(time) > 0)


def test_columns_are_what_their_names_say_and_a_short_peak_of_force_or_evidence_is_not_lost(some_step):
    history = History(np.arange(K))
    for i in range(500):
        peak = float(i == 251)
        history.add(replace(some_step, stamp=i / 100, force=np.array([0.0, -40.0 * peak, 0.0]), evidence=1.2 * peak))
    assert history.column("force").min(axis=0).tolist() == [0.0, -40.0, 0.0]
    assert history.column("evidence").max() == 1.2
    limits = some_step.thresholds
    np.testing.assert_array_equal(history.column("limits")[-1], [limits.upper, limits.lower])
    speeds = [np.linalg.norm(some_step.ee_velocity), np.linalg.norm(some_step.desired_velocity)]
    np.testing.assert_array_equal(history.column("speeds")[-1], speeds)
    assert history.column("nearest")[-1] == min(some_step.obstacles.body_distance, default=9.0)


def test_time_counts_from_the_start_and_going_back_begins_anew(some_step):
    history = History(np.arange(K), start=100.0)
    for stamp in (*np.arange(0, 5, 0.01), *np.arange(0, 1, 0.01)):
        history.add(replace(some_step, stamp=100.0 + float(stamp)))
    time = history.column("time")
    assert time[0] == 0.0
    assert time[-1] < 1.0


def test_a_history_of_one_sample_is_a_line_and_a_unit_whose_reading_is_late_shows_nothing(some_step):
    history, step = History(np.arange(K)), replace(some_step, range_distance=np.full(K, 0.5))
    assert len(history.column("time")) == 0
    history.add(step, late=np.arange(K) == 3)
    assert np.diff(history.column("time")) == pytest.approx([SAMPLE_S])
    distances = history.column("distance")
    assert distances.shape == (2, K)
    assert np.flatnonzero(distances[-1] > 1.0).tolist() == [3]  # the axis ends at 1 m


def test_axes_of_force_are_symmetric_and_grow_with_the_force_and_no_scale_changes(some_step):
    """A page whose scale is changed no longer follows the time."""
    history, gui = History(np.arange(K)), FakeGui()
    plots = Plots(gui, history, [f"unit {i}" for i in range(K)])
    gui.more.value = True
    limits = Thresholds(*np.zeros((6, 3)))
    seen, before = [], [plot.scales for plot in gui.plots]
    for i, force in enumerate((3.0, -20.0, 65.0, np.nan)):
        history.add(replace(some_step, stamp=float(i), force=np.array([0.0, force, 0.0]), thresholds=limits))
        plots.draw(float(i))
        lines = [np.array(plot.data[-2:]) for plot in gui.plots[3:6]]
        seen.append([(frame.min(), frame.max()) for frame in lines])
    at_rest = (-FORCE_N, FORCE_N)
    assert [forces[1] for forces in seen] == [at_rest, (-30.0, 30.0), (-120.0, 120.0), (-120.0, 120.0)]
    assert all(forces[0] == forces[2] == at_rest for forces in seen)
    assert all(plot.scales is scales for plot, scales in zip(gui.plots, before, strict=True))
    assert all(len({len(line) for line in plot.data}) == 1 for plot in gui.plots)


def test_what_is_folded_is_sent_only_while_it_is_shown(some_step):
    history, gui = History(np.arange(K)), FakeGui()
    plots = Plots(gui, history, [f"unit {i}" for i in range(K)])
    history.add(some_step)
    before = [plot.data for plot in gui.plots]
    plots.draw(0.0)
    changed = [plot.data is not data for plot, data in zip(gui.plots, before, strict=True)]
    assert changed == [True, True, True, False, False, False, False]
    assert [plot.visible for plot in gui.plots[3:]] == [False] * 4
    gui.more.value = True
    plots.draw(1.0)
    assert all(plot.data is not data for plot, data in zip(gui.plots, before, strict=True))
    history.clear()
    plots.draw(2.0)
    assert np.isnan([plot.data[1] for plot in gui.plots[:3]]).all()


class FakeGui:
    """Keeps the plots of a page."""

    def __init__(self) -> None:
        self.plots: list[SimpleNamespace] = []

    def add_html(self, content: str) -> SimpleNamespace:
        return SimpleNamespace(visible=True)

    def add_checkbox(self, label: str, value: bool, hint: str) -> SimpleNamespace:
        self.more = SimpleNamespace(value=value, on_update=lambda act: None)
        return self.more

    def add_uplot(self, data: object, series: object, **look: object) -> SimpleNamespace:
        self.plots.append(SimpleNamespace(data=data, **look))
        return self.plots[-1]
