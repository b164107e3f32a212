from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from pretouch.types import ControlStep, Mode
from pretouch.viewer import palette
from pretouch.viewer.status import PERIOD_S, Status, legend


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


def test_a_mode_comes_with_its_colour_and_sentence(status: Status, html: Html, some_step: ControlStep) -> None:
    for mode in Mode:
        status.draw(replace(some_step, mode=mode, reason=f"Why {mode.value}."), "t = 1 s", "", 0.0)
        assert f">{mode.name}<" in html.sent[-1]
        assert f"Why {mode.value}." in html.sent[-1]
        assert palette.css(palette.MODES[mode]) in html.sent[-1]


def test_it_is_sent_five_times_a_second_and_at_once_when_there_is_news(
    status: Status, html: Html, some_step: ControlStep
) -> None:
    for i in range(300):
        status.draw(some_step, f"t = {i} s", "", i / 30)
    assert len(html.sent) <= 10 / PERIOD_S + 1
    sent = len(html.sent)
    status.draw(replace(some_step, mode=Mode.HOLD), "", "", 300 / 30)
    assert len(html.sent) == sent + 1


def test_what_a_person_is_told_and_the_warning_are_both_shown(
    status: Status, html: Html, some_step: ControlStep
) -> None:
    status.draw(some_step, "", "Too slow.", 0.0)
    assert "id='warning'" in html.sent[-1]
    assert "id='notice'" not in html.sent[-1]
    status.notice = "Not done."
    status.draw(some_step, "", "Too slow.", 0.0)
    assert html.sent[-1].index("Not done.") < html.sent[-1].index("Too slow.")


def test_words_are_not_taken_for_markup(status: Status, html: Html, some_step: ControlStep) -> None:
    status.notice = "<b>a & b</b>"
    status.draw(replace(some_step, reason="<script>"), "<i>", "", 0.0)
    assert "&lt;b&gt;a &amp; b&lt;/b&gt;" in html.sent[-1]
    assert "<script>" not in html.sent[-1]
    assert "<i>" not in html.sent[-1]


def test_the_legend_names_every_colour_of_the_trail() -> None:
    shown = legend()
    for colour in (palette.FOLLOWING, palette.AVOIDING, palette.RECOVERING, palette.REACTING, palette.HOLDING):
        assert palette.css(colour) in shown


def test_the_legend_names_the_marks_of_sensing() -> None:
    shown = legend()
    for name, colour in (("sensed", palette.SENSED), ("closest pair", palette.PAIR), ("silent", palette.UNIT_SILENT)):
        assert name in shown
        assert palette.css(colour) in shown
