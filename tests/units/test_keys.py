"""Files of keys: private, whole, and of nothing but keys."""

import os
import pickle
import stat

import pytest

from pretouch.errors import HardwareError
from pretouch.units.keys import Keys, UnitKey, load_keys, new_key, save_keys


def unit(id="hand", number=1, key=b"k" * 32):
    return UnitKey(id, number, key)


def test_keys_come_back_as_they_were_saved(tmp_path):
    keys = Keys([unit("hand", 7, new_key()), unit('odd "name".1', 65535, new_key())])
    path = tmp_path / "keys.toml"
    save_keys(keys, path)
    assert dict(load_keys(path)) == dict(keys) == dict(pickle.loads(pickle.dumps(keys)))  # noqa: S301
    assert load_keys(path).by_number[7].id == "hand"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert os.listdir(tmp_path) == ["keys.toml"]


def test_saving_over_an_open_file_makes_it_private(tmp_path):
    path = tmp_path / "keys.toml"
    path.write_text("")
    path.chmod(0o644)
    save_keys(Keys([unit()]), path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o601])
def test_a_file_others_can_get_at_is_refused(tmp_path, mode):
    path = tmp_path / "keys.toml"
    save_keys(Keys([unit()]), path)
    path.chmod(mode)
    with pytest.raises(HardwareError, match=f"chmod 600 {path}"):
        load_keys(path)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("x = ", "not a TOML"),
        ("hand = 3", "a number and a key"),
        ("[hand]\nnumber = 1", "a number and a key"),
        (f"[hand]\nnumber = 1\nkey = '{'0' * 62}'", "31 bytes, not 32"),
        (f"[hand]\nnumber = 1\nkey = '{'x' * 64}'", "hexadecimal"),
        ("[hand]\nnumber = 1\nkey = 5", "hexadecimal"),
        (f"[hand]\nnumber = 0\nkey = '{'0' * 64}'", "number of unit hand is 0"),
        (f"[hand]\nnumber = true\nkey = '{'0' * 64}'", "number of unit hand is True"),
        (f"[hand]\nnumber = {'9' * 5000}\nkey = '{'0' * 64}'", "not a TOML"),
        (f"[hand]\nnumber = 0x{'f' * 5000}\nkey = '{'0' * 64}'", "number of unit hand is none"),
        (f"[hand]\nnumber = '3'\nkey = '{'0' * 64}'", "number of unit hand is none"),
        (f"a = {'[' * 20000}{']' * 20000}", "not a TOML"),
        (f'["a\\u001b[2J"]\nnumber = 1\nkey = "{"0" * 64}"', "printable name"),
        (f"[a]\nnumber = 1\nkey = '{'0' * 64}'\n[b]\nnumber = 1\nkey = '{'1' * 64}'", "both have the number 1"),
        (f"[a]\nnumber = 1\nkey = '{'0' * 64}'\n[b]\nnumber = 2\nkey = '{'0' * 64}'", "the same key"),
    ],
)
def test_what_holds_no_keys_is_refused_by_name(tmp_path, text, what):
    path = tmp_path / "keys.toml"
    path.write_text(text)
    path.chmod(0o600)
    with pytest.raises(HardwareError, match=what) as caught:
        load_keys(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("place", "read", "written"),
    [
        ("none/keys.toml", "cannot be read", "cannot be written"),
        ("folder", "cannot be read", "cannot be written"),
        ("a\0b", "cannot be a file name", "cannot be a file name"),
    ],
)
def test_a_place_that_holds_no_file_is_an_error_of_ours(tmp_path, place, read, written):
    (tmp_path / "folder").mkdir()
    with pytest.raises(HardwareError, match=read):
        load_keys(tmp_path / place)
    with pytest.raises(HardwareError, match=written):
        save_keys(Keys(), tmp_path / place)
    assert os.listdir(tmp_path) == ["folder"]


def test_a_key_that_stands_in_another_place_is_not_shown(tmp_path):
    path = tmp_path / "keys.toml"
    path.write_text(f"[hand]\nnumber = '{'ab' * 32}'\nkey = '03'")
    path.chmod(0o600)
    with pytest.raises(HardwareError) as caught:
        load_keys(path)
    assert "abab" not in str(caught.value)
    for place in ("number", "id"):
        with pytest.raises(HardwareError) as caught:
            unit(**{place: b"k" * 32})
        assert "kkk" not in str(caught.value)


def test_a_file_of_another_owner_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "keys.toml"
    save_keys(Keys([unit()]), path)
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    with pytest.raises(HardwareError, match=f"belongs to user {path.stat().st_uid}"):
        load_keys(path)


def test_two_units_of_one_name_are_refused():
    with pytest.raises(HardwareError, match="Two units are named hand"):
        Keys([unit(), unit(number=2, key=b"x" * 32)])


@pytest.mark.parametrize(
    ("field", "values"), [("id", ["", "a\ud800", "a\n", 5]), ("number", [65536, 1.0]), ("key", [b"", "k" * 32])]
)
def test_a_unit_that_cannot_be_is_refused(field, values):
    for value in values:
        with pytest.raises(HardwareError):
            unit(**{field: value})


def test_no_key_shows_in_print():
    assert "k" * 8 not in repr(unit())
    assert "6b6b" not in repr(Keys([unit()]))
