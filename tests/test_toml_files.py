"""Reading of TOML files: bounds on time and memory that no honest file meets."""

import tomllib
from pathlib import Path

import pytest

from pretouch.toml_files import LARGEST_FILE, parsed_toml, read_toml


@pytest.mark.parametrize(
    "key", ["a" + ".a" * 50_000, ".".join(['"="'] * 50_000), "a . '.' .b" + " .\ta" * 30, f"[{'a.' * 40}a]\nb"]
)
def test_a_key_of_many_parts_is_refused_before_it_is_parsed(key, monkeypatch):
    monkeypatch.setattr(tomllib, "loads", lambda _text: pytest.fail("it was parsed"))
    with pytest.raises(ValueError, match="more than 20 parts"):
        parsed_toml(f"{key} = 1\n".encode())


@pytest.mark.parametrize(
    "text",
    [
        "a = '" + "x." * 40 + "'", 'a = "' + "x." * 40 + '"', 'a = """\n"' + "x." * 40 + '\\""""""',
        "a = '''\n''" + "x." * 40 + "'''", "# " + "x." * 40, "a = [" + "1.5, " * 100 + "]",
        ".".join("abcdefghijklmnopqrst") + " = 1",
        "", 'a."b.c".d = 1979-05-27T07:32:00.999',
    ],
)  # fmt: skip
def test_what_is_no_key_and_keys_that_people_write_are_read(text):
    assert parsed_toml(text.encode()) == tomllib.loads(text)


@pytest.mark.parametrize(
    "text", ['a = "' + '\\"' * 400_000, 'a = """' + '\\"""' * 200_000, "'''" * 300_001, "[" * 100_000]
)
def test_what_has_no_end_is_refused(text):
    with pytest.raises(ValueError, match=r"."):
        parsed_toml(text.encode())


def test_a_file_is_read_no_further_than_its_bound(tmp_path):
    with pytest.raises(ValueError, match="larger than 2000000 bytes"):
        read_toml(Path("/dev/zero"))
    (tmp_path / "a.toml").write_bytes(b"#" * LARGEST_FILE)
    assert read_toml(tmp_path / "a.toml") == {}
