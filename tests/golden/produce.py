"""Run all inputs in this checkout and keep their steps: `python -m tests.golden.produce FILE`."""

import sys
from pathlib import Path

import pretouch
from tests.golden.closed import CLOSED
from tests.golden.kept import summary, write
from tests.golden.streams import STREAMS, run


def produce(place: Path) -> None:
    """Write the steps of all inputs to a file."""
    root = Path(__file__).parents[2]
    if not Path(pretouch.__file__).is_relative_to(root):
        raise ImportError(f"The package is imported from {pretouch.__file__}, and not from {root}.")
    steps = {name: run(stream) for name, stream in STREAMS.items()}
    steps |= {name: made() for name, made in CLOSED.items()}
    write(place, steps)
    print(f"{root.name}: {summary(steps)}.")


if __name__ == "__main__":
    produce(Path(sys.argv[1]))
