import subprocess
from pathlib import Path

import pytest
from tools.house import __main__ as house
from tools.house import words
from tools.house.source import Function, Source, import_cycle

TEXT = '''"""A module."""
def wide(a, b, /, c, *, d):
    """Two lines."""
    found = a  # fmt: skip
    return found


class Kind:
    def of_object(self, a):
        async def within():
            pass


class _Kind:
    pass
'''


def test_lines_functions_and_names_are_counted(tmp_path: Path) -> None:
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "m.py").write_text(TEXT)
    source = Source((tmp_path / "p").rglob("*.py"), tmp_path)
    assert source.files == {Path("p/m.py"): 15}
    assert (source.lines, source.format_skips, source.participles, source.repeated_classes) == (15, 1, 1, ["Kind"])
    assert sorted(source.functions, key=lambda f: f.place) == [
        Function("p/m.py:of_object", 3, 1),
        Function("p/m.py:wide", 4, 4),
        Function("p/m.py:within", 2, 0),
    ]


def test_hard_words_are_named_and_plain_ones_pass(tmp_path: Path, capsys) -> None:
    (tmp_path / "src").mkdir()
    for name, text in {
        "m": '"""Of it."""\ndef f(_told, of, given_by):\n    "Whatever."\n    of.made = of.held(whole=1)\n',
        "n": 'class A:\n    known: int\n    "Whether."\n    b: int\n    "Whether c, d."\n    c = "What is this?"',
        "o": "thing = 1",
    }.items():
        (tmp_path / "src" / f"{name}.py").write_text(text)
    assert words.main(tmp_path) == 1
    places = [line.split(": ")[0] for line in capsys.readouterr().out.splitlines()]
    assert sorted(places) == [f"src/{place}" for place in ("m.py:1", "m.py:2", "m.py:4", "n.py:2", "n.py:5")]
    assert words.main(tmp_path / "docs") == 0


def test_a_circle_of_imports_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "circled"
    package.mkdir()
    for name, text in {
        "__init__": "",
        "a": "from circled import b",
        "b": "def f():\n    import circled.c",
        "c": "",
    }.items():
        (package / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    assert import_cycle(["circled"]) == []
    (package / "c.py").write_text("import circled.a")
    cycle = import_cycle(["circled"])
    assert cycle[0] == cycle[-1]
    assert set(cycle) == {"circled.a", "circled.b", "circled.c"}


def test_a_measure_beyond_its_bound_fails(monkeypatch, capsys, tmp_path) -> None:
    monkeypatch.setattr(house, "BOUNDS", tmp_path / "bounds.toml")
    house.BOUNDS.write_text("lines = 10\nfiles = 4\n")
    monkeypatch.setattr(house, "measures", lambda: [house.Measure("lines", 10, 5), house.Measure("files", 3, 5)])
    assert house.main() == 0
    monkeypatch.setattr(house, "measures", lambda: [house.Measure("lines", 11, 5), house.Measure("words", 0, 5)])
    assert house.main() == 1
    assert "Beyond the bound: lines, words." in capsys.readouterr().out


def _git(*words: str) -> str:
    done = subprocess.run(("git", *words), cwd=house.ROOT, capture_output=True, text=True, check=False)  # noqa: S607
    return done.stdout if done.returncode == 0 else ""


def test_no_bound_is_higher_than_in_the_commits_before() -> None:
    file = str(house.BOUNDS.relative_to(house.ROOT))
    now = house.bounds(house.BOUNDS.read_text())
    for commit in _git("log", "-n", "2", "--format=%H", "--", file).split():  # none without history
        before = house.bounds(_git("show", f"{commit}:{file}"))
        raised = {name for name in now.keys() & before.keys() if now[name] > before[name]}
        assert not raised, f"{', '.join(sorted(raised))}: above the bound of {commit[:8]}"
        assert before.keys() <= now.keys(), f"a bound of {commit[:8]} is gone"
