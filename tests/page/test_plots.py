from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.page.plots import SAMPLE_S, SAMPLES, SPAN_S, History, Plots


def test_a_history_holds_the_last_seconds_and_no_more(some_step):
    history = History()
    for i in range(6000):
        history.add(replace(some_step, stamp=i / 100))
    time = history.column("time")
    assert len(time) <= SAMPLES + 1
    assert time[-1] == pytest.approx(59.99, abs=0.1)
    assert SPAN_S - 0.2 <= time[-1] - time[0] <= SPAN_S + 0.2
    assert np.all(np.diff(time) > 0)


def test_columns_are_what_their_names_say_and_a_short_peak_of_evidence_is_not_lost(some_step):
    history = History()
    for i in range(500):
        history.add(replace(some_step, stamp=i / 100, evidence=1.2 * (i == 251)))
    assert history.column("evidence").max() == 1.2
    speeds = [np.linalg.norm(some_step.ee_velocity), np.linalg.norm(some_step.desired_velocity)]
    np.testing.assert_array_equal(history.column("speeds")[-1], speeds)
    assert history.column("nearest")[-1] == min(some_step.obstacles.body_distance, default=9.0)


def test_time_counts_from_the_start_and_going_back_begins_anew(some_step):
    history = History(start=100.0)
    for stamp in (*np.arange(0, 5, 0.01), *np.arange(0, 1, 0.01)):
        history.add(replace(some_step, stamp=100.0 + float(stamp)))
    time = history.column("time")
    assert time[0] == 0.0
    assert time[-1] < 1.0


def test_a_history_of_one_sample_is_a_line(some_step):
    history = History()
    assert len(history.column("time")) == 0
    history.add(some_step)
    assert np.diff(history.column("time")) == pytest.approx([SAMPLE_S])
    assert history.column("speeds").shape == (2, 2)


def test_plots_show_the_history_and_nothing_of_one_that_is_forgotten(some_step):
    history, gui = History(), FakeGui()
    plots = Plots(gui, history)
    history.add(some_step)
    plots.draw(0.0)
    assert all(np.isfinite(plot.data[1]).all() for plot in gui.plots)
    history.clear()
    plots.draw(1.0)
    assert all(np.isnan(plot.data[1]).all() for plot in gui.plots)


class FakeGui:
    """Keeps the plots of a page."""

    def __init__(self) -> None:
        self.plots: list[SimpleNamespace] = []

    def add_html(self, content: str) -> SimpleNamespace:
        return SimpleNamespace(visible=True)

    def add_uplot(self, data: object, series: object, **look: object) -> SimpleNamespace:
        self.plots.append(SimpleNamespace(data=data, **look))
        return self.plots[-1]
