"""The file a unit with zones loads, from a header like ST's."""

from pathlib import Path

import pytest
from tools.vl53l5cx_bin import main, program_of

SIZES = {"FIRMWARE": 86_016, "DEFAULT_CONFIGURATION": 972, "DEFAULT_XTALK": 776}


def header(sizes: dict[str, int]) -> str:
    arrays = [
        f"const uint8_t VL53L5CX_{name}[] = {{ /* {size} }} */\n" + ",\n".join(f"0x{k % 256:02X}" for k in range(size))
        + ",\n};  // {1, 2}\n"
        for name, size in sizes.items()
    ]  # fmt: skip
    return "#ifndef A\n/* uint8_t X_FIRMWARE[] = {1} */\n" + "".join(arrays)


def test_the_three_arrays_go_behind_a_mark_as_the_firmware_wants_them(tmp_path: Path) -> None:
    (tmp_path / "buffers.h").write_text(header(SIZES))
    assert main([str(tmp_path / "buffers.h"), str(tmp_path / "out.bin")]) == 0
    made = (tmp_path / "out.bin").read_bytes()
    assert made == b"PTL5" + b"".join(bytes(k % 256 for k in range(size)) for size in SIZES.values())
    assert len(made) == 87_768


def test_what_is_missing_or_of_another_size_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match=r"no array ..._DEFAULT_XTALK"):
        program_of(header({name: size for name, size in SIZES.items() if name != "DEFAULT_XTALK"}))
    with pytest.raises(ValueError, match=r"..._FIRMWARE has 86015 bytes, not 86016"):
        program_of(header(SIZES | {"FIRMWARE": 86_015}))
    assert main([str(tmp_path / "none.h"), str(tmp_path / "out.bin")]) == 1
    assert "none.h" in capsys.readouterr().err
    assert main([]) == 2
