"""Makes `vl53l5cx.bin` for a unit from the header `vl53l5cx_buffers.h` of ST's driver, which only ST distributes.

python tools/vl53l5cx_bin.py vl53l5cx_buffers.h build/unit/vl53l5cx.bin
"""

import re
import sys
from pathlib import Path

MARK = b"PTL5"
_ARRAYS = {"FIRMWARE": 86_016, "DEFAULT_CONFIGURATION": 972, "DEFAULT_XTALK": 776}
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)


def program_of(header: str) -> bytes:
    """Return the file for a unit from the text of ST's header. Raises ValueError for a missing array."""
    text = _COMMENT.sub("", header)
    return MARK + b"".join(_array(text, name, size) for name, size in _ARRAYS.items())


def _array(text: str, name: str, size: int) -> bytes:
    match = re.search(rf"\w+_{name}\s*\[\w*\]\s*=\s*\{{([^}}]*)\}}", text)
    if not match:
        raise ValueError(f"There is no array ..._{name}: give vl53l5cx_buffers.h of ST's driver (STSW-IMG023).")
    values = bytes(int(word, 0) for word in re.findall(r"\w+", match.group(1)))
    if len(values) != size:
        raise ValueError(f"The array ..._{name} has {len(values)} bytes, not {size}: use version 2.0 of ST's driver.")
    return values


def main(arguments: list[str]) -> int:
    """Write the file."""
    if len(arguments) != 2:
        print(__doc__)
        return 2
    source, target = map(Path, arguments)
    try:
        target.write_bytes(program_of(source.read_text(errors="replace")))
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{target} holds {target.stat().st_size} bytes: copy it to the unit.")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
