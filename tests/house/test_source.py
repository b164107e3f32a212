from pathlib import Path

import pytest
from tools.house import __main__ as house
from tools.house.source import Function, Source, import_cycle

TEXT = '''"""A module."""
# a reason
def wide(a, b, /, c, *, d):  # equation 1
    """Two lines."""
    return a  # fmt: skip


class Kind:
    def of_object(self, a):
        async def within():
            pass
'''


def test_functions_lines_and_comments_are_counted(tmp_path: Path) -> None:
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "m.py").write_text(TEXT)
    source = Source(tmp_path / "p")
    assert source.files == {tmp_path / "p" / "m.py": 11}
    assert sorted(source.functions, key=lambda f: f.place) == [
        Function("p/m.py:of_object", 3, 1), Function("p/m.py:wide", 3, 4), Function("p/m.py:within", 2, 0),
    ]  # fmt: skip
    assert source.comment_share == 2 / 8


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
    found = import_cycle(["circled"])
    assert found[0] == found[-1]
    assert set(found) == {"circled.a", "circled.b", "circled.c"}


def test_what_is_beyond_what_is_held_fails(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    kept = [house.Measure("lines", 10, 10, 5), house.Measure("comments", 5, 5, least=True)]
    monkeypatch.setattr(house, "measures", lambda: kept)
    assert house.main() == 0
    kept += [house.Measure("words", 11, 10), house.Measure("reasons", 4, 5, least=True)]
    assert house.main() == 1
    assert "Beyond what is held: words, reasons." in capsys.readouterr().out
