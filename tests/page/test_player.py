from dataclasses import replace

import numpy as np
import pytest

from pretouch.page.player import Player, Timeline
from pretouch.types import Contact, ControlStep, Mode

STAMPS = 100.0 + np.arange(101) / 100


def test_playing_takes_as_long_as_it_took_and_a_paused_player_stands() -> None:
    player = Player(STAMPS)
    player.advance(1.0)
    assert player.index == 0
    player.play()
    for _ in range(15):
        player.advance(1 / 30)
    assert player.time == pytest.approx(0.5)
    assert player.index == 50
    player.speed = 2.0
    for _ in range(15):
        player.advance(1 / 30)
    assert player.ended
    assert not player.playing
    assert player.index == 100


def test_from_the_end_it_plays_from_the_start() -> None:
    player = Player(STAMPS)
    player.seek(9.0)
    assert player.time == pytest.approx(1.0)
    player.play()
    assert player.time == 0.0


@pytest.mark.parametrize("index", range(0, 101, 7))
def test_steps_on_and_back_are_single(index: int) -> None:
    player = Player(STAMPS)
    player.seek_index(index)
    assert player.index == index
    player.step(1)
    assert player.index == min(index + 1, 100)
    player.step(-1)
    player.step(-1)
    assert player.index == max(0, min(index + 1, 100) - 2)


def test_what_happened_is_found_bit_by_bit(some_step: ControlStep) -> None:
    contact = Contact(np.array([12.0, 0.0, 0.0]), np.array([True, False, False]))
    moves = {"reaction_velocity": np.array([0.1, 0.0, 0.0]), "command": np.full(7, 0.1)}
    steps = [
        replace(some_step, mode=Mode.REACT if 40 <= i < 60 else Mode.TRACK, contact=contact if i == 40 else None)
        for i in range(100)
    ]
    steps[45] = replace(steps[45], **moves)
    timeline = Timeline(steps.__getitem__, len(steps))
    timeline.search(45)
    assert [h.index for h in timeline.found] == [40]
    assert timeline.share == 0.45
    timeline.search(100)
    assert timeline.done
    assert [(h.index, h.what) for h in timeline.found] == [(40, "Contact of 12.0 N"), (60, "REACT to TRACK")]
    first, second = timeline.found
    assert timeline.after(0) is first
    assert timeline.after(40) is second
    assert timeline.after(60) is None
    assert timeline.before(60) is first
    assert timeline.before(40) is None


def test_a_contact_that_did_not_move_the_arm_is_told_as_it_ends(some_step: ControlStep) -> None:
    contact = Contact(np.array([6.0, 0.0, 0.0]), np.array([True, False, False]))
    held = replace(some_step, mode=Mode.REACT, command=np.zeros(7), reaction_velocity=np.zeros(3))
    steps = [some_step, replace(held, contact=contact), held, some_step]
    timeline = Timeline(steps.__getitem__, len(steps))
    timeline.search(4)
    assert [h.what for h in timeline.found] == [
        "Contact of 6.0 N", "REACT to TRACK, after a contact that did not move the arm"
    ]  # fmt: skip
