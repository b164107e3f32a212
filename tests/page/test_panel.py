"""The panel: what is queued, how well the page keeps up, and what the status says."""

import threading
from itertools import pairwise
from types import SimpleNamespace

import pytest

from pretouch.explanation import Doing, Explanation
from pretouch.page import palette
from pretouch.page.panel import STATUS_PERIOD_S, ActionQueue, Pace, Status
from pretouch.page.trail import Activity
from pretouch.types import Mode

PERIOD = 1 / 30


def test_of_one_kind_only_the_newest_waits_and_in_its_own_place():
    actions = ActionQueue()
    for i in range(1000):
        actions.put(lambda i=i: i, "hand")
        if i == 500:
            actions.put(lambda: -1)
    assert len(actions) == 2
    assert [action.run() for action in actions.take()] == [-1, 999]
    assert actions.take() == []


def test_what_has_to_settle_waits_until_nothing_newer_came_for_so_long():
    actions = ActionQueue()
    for i, now in enumerate((0.0, 0.7, 1.4)):
        actions.put(lambda i=i: i, "number", settle=0.8)
        assert actions.take(now) == []
    assert actions.take(2.1) == []
    assert actions.is_waiting("number")
    assert [action.run() for action in actions.take(2.2)] == [2]
    assert not actions.is_waiting("number")


def test_something_else_asked_for_ends_the_wait_of_what_came_before_and_quiet_things_do_not():
    actions = ActionQueue()
    actions.put(lambda: "typed", "number", settle=0.8)
    actions.put(lambda: "hand", "hand", quiet=True)
    assert [action.run() for action in actions.take(0.0)] == ["hand"]
    actions.put(lambda: "button")
    actions.put(lambda: "typed later", "other number", settle=0.8)
    assert [action.run() for action in actions.take(0.1)] == ["typed", "button"]
    assert actions.is_waiting("other number")
    assert [action.run() for action in actions.take()] == ["typed later"]


def test_nothing_is_lost_between_threads():
    actions, done, end = ActionQueue(), [], threading.Event()

    def ask(start: int) -> None:
        for i in range(start, start + 500):
            actions.put(lambda i=i: done.append(i))

    def obey() -> None:
        while not (end.is_set() and not len(actions)):
            for action in actions.take():
                action.run()

    people = [threading.Thread(target=ask, args=(1000 * k,)) for k in range(4)]
    loop = threading.Thread(target=obey)
    for thread in (*people, loop):
        thread.start()
    for thread in people:
        thread.join()
    end.set()
    loop.join()
    assert sorted(done) == sorted(1000 * k + i for k in range(4) for i in range(500))
    assert all([i for i in done if i // 1000 == k] == list(range(1000 * k, 1000 * k + 500)) for k in range(4))


# how well a page keeps up


def run(pace: Pace, start: float, seconds: float, period: float) -> float:
    """Tick every `period` [s], each time 1/30 s being simulated; return the time after."""
    for _ in range(round(seconds / period)):
        start += period
        pace.tick(start, PERIOD)
    return start


def test_a_machine_that_keeps_up_says_nothing():
    pace = Pace()
    run(pace, 0.0, 10.0, PERIOD)
    assert (pace.slow, pace.sentence()) == (False, "")


def test_a_slow_machine_is_named_after_a_while_with_its_share_until_it_keeps_up():
    pace = Pace()
    now = run(pace, 0.0, 1.5, 2 * PERIOD)
    assert not pace.slow
    now = run(pace, now, 4.0, 2 * PERIOD)
    assert pace.slow
    assert "50 %" in pace.sentence()
    assert "with the same physics" in pace.sentence()
    now = run(pace, now, 0.8, PERIOD)
    assert pace.slow
    assert "100 %" not in pace.sentence()
    run(pace, now, 1.5, PERIOD)
    assert not pace.slow


def test_a_hiccup_is_not_slowness_and_what_is_said_does_not_flap_at_the_limit():
    pace = Pace()
    now = run(pace, 0.0, 5.0, PERIOD)
    pace.tick(now + 0.5, PERIOD)
    now = run(pace, now + 0.5, 5.0, PERIOD)
    assert not pace.slow
    states = []
    for turn in range(60):
        now = run(pace, now, 0.5, PERIOD * (1.15 if turn % 2 else 1.08))
        states.append(pace.slow)
    assert sum(a != b for a, b in pairwise(states)) <= 1


# what the arm does


class Html:
    """Stands in for the page's element, and keeps what is sent."""

    def __init__(self) -> None:
        self.__dict__["sent"] = []

    def __setattr__(self, key: str, value: str) -> None:
        if self.sent[-1:] != [value]:  # viser sends no value again
            self.sent.append(value)


@pytest.fixture
def html():
    return Html()


@pytest.fixture
def status(html):
    return Status(SimpleNamespace(add_html=lambda content: html))


FREE = Explanation(Doing.MOVING, "Moving.")


def test_each_word_comes_with_its_sentence_and_the_mode(status, html):
    for i, doing in enumerate(Doing):
        status.draw(Mode.REACT, Explanation(doing, f"Why {doing.value}."), "1.0 s", "", float(i))
        assert f">{doing.value.upper()}<" in html.sent[-1]
        assert f"Why {doing.value}." in html.sent[-1]
        assert "<span id='mode'>REACT</span> · 1.0 s" in html.sent[-1]


def test_it_is_sent_five_times_a_second_and_at_once_when_there_is_news(status, html):
    for i in range(300):
        status.draw(Mode.TRACK, FREE, f"t = {i} s", "", i / 30)
    assert len(html.sent) <= 10 / STATUS_PERIOD_S + 1
    sent = len(html.sent)
    status.draw(Mode.TRACK, Explanation(Doing.SLOWED, "Slowed to 17 %."), "", "", 300 / 30)
    assert len(html.sent) == sent + 1


def test_notice_and_warning_are_both_shown_and_no_words_are_taken_for_markup(status, html):
    status.draw(Mode.TRACK, FREE, "", "Too slow.", 0.0)
    assert "id='warning'" in html.sent[-1]
    assert "id='notice'" not in html.sent[-1]
    status.notice = "<b>a & b</b>"
    status.draw(Mode.TRACK, Explanation(Doing.MOVING, "<script>"), "<i>", "Too slow.", 0.0)
    assert html.sent[-1].index("&lt;b&gt;a &amp; b&lt;/b&gt;") < html.sent[-1].index("Too slow.")
    assert "<script>" not in html.sent[-1]
    assert "<i>" not in html.sent[-1]


def test_the_legend_names_every_colour_of_the_trail_and_the_marks_of_sensing():
    legend = palette.legend()
    for activity in Activity:
        assert palette.css(activity.value) in legend
    for name, colour in (("seen", palette.SENSED), ("closest pair", palette.PAIR), ("silent", palette.UNIT_SILENT)):
        assert name in legend
        assert palette.css(colour) in legend
