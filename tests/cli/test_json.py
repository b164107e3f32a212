"""--json: every command that shows numbers has it, and - gives one document and nothing else."""

import json
import math
from collections.abc import Iterator
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

from pretouch import cli
from pretouch.cli.app import command_class, command_names
from pretouch.cli.writing import numbers_to
from pretouch.recording.writer import Recording
from pretouch.session.push import GuidedPush
from tests.following_arm import Arm
from tests.imported_data.files import force_columns, pushed, write_csv
from tests.importing.made import six_axis, written


def single(name: str, kind: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and class of a command, or of each one that stands below it, as below `skin`, `robot` and `bench`."""
    what = get_type_hints(kind, include_extras=True).get("what")
    below = [each for each in get_args(what) if hasattr(each, "__metadata__")]
    if not below:
        yield name, kind
    for each in below:
        called, *_ = (one.name for one in each.__metadata__)
        yield from single(f"{name} {called}", each.__origin__)


COMMANDS: dict[str, Any] = dict(pair for name in command_names() for pair in single(name, command_class(name)))
"""Class of each command, by its words."""
WITHOUT = {
    "live",
    "report",
    "skin check-unit",
    "skin simulate",
    "skin provision",
    "warm-up",
    "serve-fci",
    "figure",
    "policy",
}
"""Commands that conclude with no numbers: they serve a page or an arm, write a page or a picture, or set up."""


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_which_says_what_a_dash_does_if_it_concludes_with_numbers(capsys, name):
    with pytest.raises(SystemExit) as stop:
        cli.main([*name.split(), "--help-all" if name == "run" else "--help"])
    assert stop.value.code == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert f"usage: pretouch {name} " in said
    of_json = [part.partition("--")[0] for part in said.split("--json ")[1:]]
    assert any("standard output" in part for part in of_json) == (name not in WITHOUT)


@pytest.fixture(scope="module")
def files(tmp_path_factory, panda_model, paper_skin):
    """A folder with a force, an arm, keys, and a recording with a push."""
    folder = tmp_path_factory.mktemp("files")
    forces = pushed(5.0, ((2.0, 0.6, (0.0, 40.0, 0.0)),))
    write_csv(folder / "force.csv", force_columns(forces))
    arm = Arm(panda_model, paper_skin)
    with Recording(folder / "run.mcap", arm.controller) as recording:
        for sample in forces:
            recording.record(arm.turn(tuple(sample)))
    told = ["robot", "import", str(written(folder, six_axis())), "--capsules", "1", "--ready", "0,0.3,1.2,0,1.6,0"]
    assert cli.main([*told, "--out", str(folder / "arm")]) == 0
    written(folder, "a: {link: link3, position: [0.06, 0, 0.1], normal: [1, 0, 0]}", "units.yaml")
    assert cli.main(["skin", "keys", "--keys", str(folder / "keys.toml"), "--new", "a,b"]) == 0
    return folder


@pytest.mark.parametrize(
    ("words", "holds"),
    [
        ("skin keys --keys keys.toml", {"units"}),
        ("skin monitor --keys keys.toml --port 0 --duration 0.3", {"elapsed_s", "units", "findings"}),
        ("skin coverage --postures 2", {"links", "blind_spots"}),
        ("skin import units.yaml --arm arm --out skin.toml", {"arm", "units", "remarks"}),
        ("detect force.csv --profiles paper,blind", {"first_sample_s", "profiles"}),
        ("replay run.mcap --no-page", {"contacts", "held_share", "duration_s"}),
        ("replay run.mcap --verify", {"verified"}),
        ("replay run.mcap --no-page --profile blind", {"compared"}),
        ("run --no-skin --profile blind --path hold --seconds 0.2 --yes", {"summary", "ending", "timing"}),
    ],
)
def test_a_dash_is_one_document_on_standard_output_and_text_beside_it(files, capsys, monkeypatch, words, holds):
    monkeypatch.chdir(files)
    monkeypatch.setenv("XDG_STATE_HOME", str(files))
    monkeypatch.setattr(GuidedPush, "confirm", lambda *_: None)
    monkeypatch.setattr("pretouch.session.may_move.WATCH_S", 0.5)
    code = cli.main([*words.split(), "--json", "-"])
    said = capsys.readouterr()
    assert code == int("monitor" in words)  # no unit is heard
    found = json.loads(said.out, parse_constant=pytest.fail)
    assert holds <= set(found)
    assert said.err.strip()
    assert not (files / "-").exists()


def test_what_ends_a_command_leaves_standard_output_empty(capsys, tmp_path):
    assert cli.main(["replay", str(tmp_path / "gone.mcap"), "--no-page", "--json", "-"]) == 2
    assert capsys.readouterr().out == ""


def test_a_file_of_numbers_is_named_and_holds_null_for_what_is_not_finite(capsys, tmp_path):
    odd = [-math.inf, {"c": np.float32("nan")}, True]
    with numbers_to(tmp_path / "new" / "a.json") as write:
        print("text")
        write({"force_n": np.array([1.0, math.nan]), "count": np.int64(3), "pair": (1, None), "odd": odd})
    assert capsys.readouterr().out == f"text\nNumbers: {tmp_path / 'new' / 'a.json'}\n"
    assert json.loads((tmp_path / "new" / "a.json").read_text()) == {
        "force_n": [1, None],
        "count": 3,
        "pair": [1, None],
        "odd": [None, {"c": None}, True],
    }
