"""README's moving picture, and what draws it."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence
from tools.picture import FROM_S, HEIGHT_PX, TO_S, WIDTH_PX, drawn, record

import pretouch as pt
from pretouch.page import palette

ROOT = Path(__file__).parents[2]


def durations(place):
    """How long each frame of a picture is shown [s]."""
    with Image.open(place) as picture:
        shown = []
        for frame in ImageSequence.Iterator(picture):
            frame.load()  # a frame of WebP has its duration once it is read
            shown.append(frame.info["duration"] / 1000)
        return shown


def test_the_readme_begins_with_the_picture_and_says_in_words_what_happens():
    readme = (ROOT / "README.md").read_text()
    (words, name), *_ = re.findall(r"!\[([^\]]*)\]\((\S+)\)", readme)
    assert {"hand", "slows", "moves"} <= set(re.findall(r"\w+", words))
    place = ROOT / name
    assert place.stat().st_size < 3e6
    with Image.open(place) as picture:
        assert picture.size == (WIDTH_PX, HEIGHT_PX)
    assert sum(durations(place)) == pytest.approx(TO_S - FROM_S)
    assert 7.0 < TO_S - FROM_S < 12.0


@pytest.mark.slow
def test_a_recording_is_drawn_with_word_and_sentence_over_the_arm(tmp_path):
    record(tmp_path / "short.mcap", until=1.8)
    recorded = pt.open_recording(tmp_path / "short.mcap")
    waits, moves = (np.asarray(image, float) for image in drawn(recorded, [0.8, 1.8]))
    assert waits.shape == moves.shape == (HEIGHT_PX, WIDTH_PX, 3)
    for image, colour in ((waits, palette.HOLDING), (moves, palette.RECOVERING)):
        word = np.abs(image[:60, 385:705] - colour).max(axis=2) < 12
        assert word.sum() > 500
    assert (np.abs(waits - moves)[100:, :380].max(axis=2) > 60).sum() > 500, "the arm has moved"
