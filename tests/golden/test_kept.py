"""Steps in a file, and that a comparison fails where it has to."""

from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from tests.golden.__main__ import judged, main
from tests.golden.kept import Steps, close, equal, first_difference, read, write

NAMES = "one", "other"


def made_up() -> Steps:
    """Two inputs of three steps with a field of each kind."""
    rng = np.random.default_rng(0)

    def step(i: int) -> dict[str, np.ndarray | None]:
        return {
            "command": rng.normal(size=7), "mode": np.array("hold" if i else "track"), "armed": np.array(i > 0),
            "obstacles.point": rng.normal(size=(i, 3)), "restricted": np.arange(i), "force": np.array([np.nan, 0.0, i]),
            "contact.force": rng.normal(size=3) if i == 1 else None, "speed_scale": np.array(0.1 * i),
        }  # fmt: skip

    return {name: {i: step(i) for i in range(3)} for name in ("calm", "push")}


def test_a_file_gives_back_every_bit(tmp_path: Path):
    steps = made_up()
    write(tmp_path / "a.npz", steps)
    back = read(tmp_path / "a.npz")
    assert first_difference(steps, back, equal, NAMES) == ""
    assert back["push"][0]["contact.force"] is None
    assert back["push"][2]["obstacles.point"].shape == (2, 3)
    assert back["calm"][0]["obstacles.point"].shape == (0, 3)


def test_one_bit_is_found_and_named():
    steps, other = made_up(), made_up()
    command = other["push"][1]["command"]
    command[4] = np.nextafter(command[4], np.inf)
    other["push"][2]["speed_scale"] = np.array(0.0)
    said = first_difference(steps, other, equal, NAMES)
    assert said.startswith("push, cycle 1, command: ")
    assert "apart" in said
    assert "push, cycle 2, speed_scale" in first_difference(steps, other, close, NAMES)


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        ("mode", np.array("react"), "'hold' in one, 'react' in other"),
        ("armed", np.array(False), "True in one, False in other"),
        ("contact.force", None, "none in other"),
        ("obstacles.point", np.zeros((2, 3)), "obstacles.point"),
        ("restricted", np.array([1]), "[0] in one, [1] in other"),
        ("restricted", np.array([0.0]), "restricted"),
        ("force", np.array([0.0, 0.0, 1.0]), "force"),
        ("force", np.array([np.nan, np.nan, 1.0]), "force"),
        ("force", np.array([np.nan, np.inf, 1.0]), "inf apart"),
    ],
)
def test_whatever_differs_is_found(field: str, value: np.ndarray | None, says: str):
    steps, other = made_up(), made_up()
    other["calm"][1][field] = value
    for same in (equal, close):
        said = first_difference(steps, other, same, NAMES)
        assert said.startswith(f"calm, cycle 1, {field}: ")
        assert says in said


def test_the_sign_of_a_zero_is_a_bit_of_its_own():
    steps, other = made_up(), made_up()
    other["calm"][1]["force"] = np.array([np.nan, -0.0, 1.0])
    assert "calm, cycle 1, force" in first_difference(steps, other, equal, NAMES)
    assert first_difference(steps, other, close, NAMES) == ""


def test_a_tolerance_is_absolute_below_one_and_relative_above():
    assert close(np.array([1e-13, 1e6]), np.array([0.0, 1e6 + 5e-7]))
    assert not close(np.array([2e-12]), np.array([0.0]))
    assert not close(np.array([1e6]), np.array([1e6 + 2e-6]))
    assert close(np.array([np.inf, np.nan]), np.array([np.inf, np.nan]))


def test_inputs_cycles_and_fields_that_only_one_has_are_named():
    steps = made_up()
    for take, says in (
        (lambda s: s.pop("push"), "The input push is only in one."),
        (lambda s: s["push"].pop(2), "push, cycle 2: only in one."),
        (lambda s: s["calm"][1].pop("armed"), "calm, cycle 1, armed: only in one."),
    ):
        other = deepcopy(steps)
        take(other)
        assert first_difference(steps, other, equal, NAMES) == says
        assert first_difference(other, steps, equal, NAMES[::-1]) == says


def test_what_is_left_out_is_not_compared(capsys: pytest.CaptureFixture[str]):
    steps, other = made_up(), made_up()
    other["push"][1]["armed"] = np.array(False)
    assert judged(steps, other, "abc", set()) == 1
    assert "push, cycle 1, armed: True in abc, False in this checkout." in capsys.readouterr().out
    assert judged(steps, other, "abc", {"armed"}) == 0
    assert "6 steps of 2 inputs, 7 fields: equal." in capsys.readouterr().out
    assert judged(steps, other, "abc", {"push"}) == 0
    assert "3 steps of 1 inputs, 8 fields: equal." in capsys.readouterr().out


def test_a_commit_there_is_not_is_named(capsys: pytest.CaptureFixture[str]):
    assert main(["no-such-commit"]) == 2
    assert "There is no commit 'no-such-commit'" in capsys.readouterr().out
