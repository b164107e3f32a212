"""The wiring diagrams name the pins that the firmware uses."""

import ast
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[2]
D1_MINI = {4: "D2 (GPIO 4)", 5: "D1 (GPIO 5)"}


def pins(board):
    """The GPIO numbers of a board's class in the firmware, by name."""
    (made,) = [
        n for n in ast.parse((ROOT / "firmware" / "board.py").read_text()).body if getattr(n, "name", "") == board
    ]
    named = next(node for node in made.body if isinstance(node, ast.Assign))
    (names,) = named.targets
    return {name.id: number.value for name, number in zip(names.elts, named.value.elts, strict=True)}


@pytest.mark.parametrize(
    ("file", "board", "named"), [("esp32-c3", "Esp32C3", "GPIO {}".format), ("d1-mini", "Esp8266", D1_MINI.__getitem__)]
)
def test_pins_are_those_of_the_firmware(file, board, named):
    drawing = ElementTree.parse(ROOT / "docs" / "images" / f"wiring-{file}.svg")  # noqa: S314 a file of ours
    shown = {text.get("id"): text.text for text in drawing.iter("{http://www.w3.org/2000/svg}text")}
    found = pins(board)
    for pin in ("SDA", "SCL"):
        assert shown[pin.lower()] == named(found[pin])
    assert shown["battery"] == (named(found["BATTERY"]) if "BATTERY" in found else "A0")
