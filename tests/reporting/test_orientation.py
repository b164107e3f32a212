import pytest

from pretouch.errors import ParameterError
from pretouch.reporting.orientation import ISO_TS_15066, load_limits


def test_transient_figures_are_twice_the_others_where_there_are_any():
    for region in ISO_TS_15066.regions:
        assert region.transient in (None, 2 * region.quasi_static)
    assert [r.name for r in ISO_TS_15066.regions if r.transient is None] == ["Skull and forehead", "Face"]


def test_figures_of_ones_own(tmp_path):
    place = tmp_path / "limits.toml"
    place.write_text('source = "ours"\n[[region]]\nname = "Thumb"\nquasi_static_n = 40\n')
    limits = load_limits(place)
    assert limits.source == "ours"
    assert (limits.regions[0].name, limits.regions[0].transient, limits.regions[0].quasi_static) == ("Thumb", None, 40)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("source = ", "not valid TOML"),
        ("[[region]]\nname = 'a'\nquasi_static_n = 1", "name no source"),
        ("source = 'a'", r"no \[\[region\]\]"),
        ("source = 'a'\nregion = [3]", "without a name"),
        ("source = 'a'\n[[region]]\nname = 'b'", "quasi_static_n = None"),
        ("source = 'a'\n[[region]]\nname = 'b'\nquasi_static_n = -1", "give a force in N"),
        ("source = 'a'\n[[region]]\nname = 'b'\nquasi_static_n = nan", "give a force in N"),
        ("source = 'a'\n[[region]]\nname = 'b'\nquasi_static_n = true", "give a force in N"),
        ("source = 'a'\n[[region]]\nname = 'b'\nquasi_static_n = 1\ntransient = 2", "unknown key 'transient'"),
    ],
)
def test_a_wrong_file_is_said_to_be(tmp_path, text, words):
    place = tmp_path / "limits.toml"
    place.write_text(text)
    with pytest.raises(ParameterError, match=words):
        load_limits(place)


def test_a_file_that_is_not_there_is_said_to_be_missing(tmp_path):
    with pytest.raises(ParameterError, match="No such file"):
        load_limits(tmp_path / "limits.toml")
