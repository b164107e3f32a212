from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from pretouch.robot.description import fr3
from pretouch.robot.model import RobotModel
from tests.hardware.franka.served import Served

# without the extra `franka` there is nothing to test
collect_ignore_glob = ["test_*.py"] if None in map(find_spec, ("panda_py", "pylibfranka", "ruckig")) else []


@pytest.fixture(scope="session")
def fr3_model() -> RobotModel:
    return RobotModel(fr3())


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Served]]:
    """Starts simulated arms: of a kind, with more options of `pretouch serve-fci`."""
    opened: list[Served] = []

    def start(kind: str, *more: str) -> Served:
        opened.append(Served(tmp_path, kind, *more))
        return opened[-1]

    yield start
    for served in opened:
        served.close()
