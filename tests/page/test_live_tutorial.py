"""The page of the documents about the live page names its controls, and no others."""

import re
from pathlib import Path

from pretouch.page.scene import PARTS

ROOT = Path(__file__).parents[2]
PAGE = ("commander", "controls", "drive", "live", "plots")
"""Modules that add to the live page."""
CONTROL = r'(?:add_(?:dropdown|slider|checkbox|text|button)|_button)\(\s*"([^"]+)"'
FOLDER = r'\("(\w+)", self\._\w+_folder\)'


def test_the_tutorial_names_the_controls_there_are() -> None:
    source = "\n".join((ROOT / "src" / "pretouch" / "viewer" / f"{name}.py").read_text() for name in PAGE)
    labels = {label.partition(" [")[0] for label in re.findall(CONTROL, source)} | {"Resume"}
    folders, captions = set(re.findall(FOLDER, source)), set(re.findall(r'_caption\("(\w+)', source))
    assert len(labels) > 15
    assert len(folders) > 4
    text = " ".join((ROOT / "docs" / "tutorial" / "live.md").read_text().split())
    named = set(re.findall(r"(?<!\*)\*([^*]+)\*(?!\*)", text))
    more = folders | captions | {part.capitalize() for part in PARTS}
    assert named - labels - more == set()
    assert labels - named == set()
    assert {folder for folder in folders if f"- **{folder}**" not in text} == set()
