from types import SimpleNamespace
from typing import Any

import pytest

from pretouch.explanation import Doing, Explanation
from pretouch.page import palette
from pretouch.page.status import PERIOD_S, Status, legend
from pretouch.page.trail import Activity
from pretouch.types import Mode


class Html:
    """Stands in for the page's element, and counts."""

    def __init__(self) -> None:
        self.sent: list[str] = []

    def __setattr__(self, key: str, value: Any) -> None:
        if key == "content":
            self.sent.append(value)
        self.__dict__[key] = value


@pytest.fixture
def html() -> Html:
    return Html()


@pytest.fixture
def status(html: Html) -> Status:
    return Status(SimpleNamespace(add_html=lambda content: html))  # type: ignore[arg-type]


FREE = Explanation(Doing.MOVING, "Moving.")


def test_each_word_comes_with_its_sentence_and_the_mode(status: Status, html: Html) -> None:
    for i, doing in enumerate(Doing):
        status.draw(Mode.REACT, Explanation(doing, f"Why {doing.value}."), "1.0 s", "", float(i))
        assert f">{doing.value.upper()}<" in html.sent[-1]
        assert f"Why {doing.value}." in html.sent[-1]
        assert "<span id='mode'>REACT</span> · 1.0 s" in html.sent[-1]


def test_it_is_sent_five_times_a_second_and_at_once_when_there_is_news(status: Status, html: Html) -> None:
    for i in range(300):
        status.draw(Mode.TRACK, FREE, f"t = {i} s", "", i / 30)
    assert len(html.sent) <= 10 / PERIOD_S + 1
    sent = len(html.sent)
    status.draw(Mode.TRACK, Explanation(Doing.SLOWED, "Slowed to 17 %."), "", "", 300 / 30)
    for i in range(30):  # what is the same is not sent again
        status.draw(Mode.TRACK, Explanation(Doing.SLOWED, "Slowed to 17 %."), "", "", 10 + i / 3)
    assert len(html.sent) == sent + 1


def test_what_a_person_is_told_and_the_warning_are_both_shown(status: Status, html: Html) -> None:
    status.draw(Mode.TRACK, FREE, "", "Too slow.", 0.0)
    assert "id='warning'" in html.sent[-1]
    assert "id='notice'" not in html.sent[-1]
    status.notice = "Not done."
    status.draw(Mode.TRACK, FREE, "", "Too slow.", 0.0)
    assert html.sent[-1].index("Not done.") < html.sent[-1].index("Too slow.")


def test_words_are_not_taken_for_markup(status: Status, html: Html) -> None:
    status.notice = "<b>a & b</b>"
    status.draw(Mode.TRACK, Explanation(Doing.MOVING, "<script>"), "<i>", "", 0.0)
    assert "&lt;b&gt;a &amp; b&lt;/b&gt;" in html.sent[-1]
    assert "<script>" not in html.sent[-1]
    assert "<i>" not in html.sent[-1]


def test_the_legend_names_every_colour_of_the_trail_and_the_marks_of_sensing() -> None:
    shown = legend()
    for activity in Activity:
        assert palette.css(activity.value) in shown
    for name, colour in (("sensed", palette.SENSED), ("closest pair", palette.PAIR), ("silent", palette.UNIT_SILENT)):
        assert name in shown
        assert palette.css(colour) in shown
