"""What all tests share: the arm, its skin, and how properties are searched."""

import gc
import signal
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings
from tests.needs import NEEDS

from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.sensing import skin

settings.register_profile("pretouch", deadline=None, derandomize=True, database=None, max_examples=25)
settings.register_profile("nightly", settings.get_profile("pretouch"), max_examples=100)
settings.load_profile("pretouch")


@pytest.fixture(scope="session")
def panda_model() -> RobotModel:
    return RobotModel(panda())


@pytest.fixture(scope="session")
def fr3_model() -> RobotModel:
    return RobotModel(fr3())


@pytest.fixture(scope="session")
def paper_skin(panda_model: RobotModel) -> skin.Skin:
    return skin.paper_skin(panda_model)


def pytest_configure() -> None:
    """Heed Ctrl-C and SIGHUP, here and in what is started: in the background both are ignored, which is inherited."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_finish() -> None:
    """Keep the garbage collector from what lasts: half a million objects, a second each time that a run is prepared."""
    gc.collect()
    gc.freeze()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--list-skipped", type=Path, help="write the files in which something was skipped to a file")
    parser.addoption("--skip-only", help="fail if a test was skipped but for these commands, separated by commas")


def _skipped(config: pytest.Config) -> list[pytest.TestReport]:
    return config.pluginmanager.get_plugin("terminalreporter").stats.get("skipped", [])


def pytest_sessionfinish(session: pytest.Session) -> None:
    if hasattr(session.config, "workerinput"):  # the process that started the workers tells of them all
        return
    skipped, listed = _skipped(session.config), session.config.option.list_skipped
    if listed:
        listed.parent.mkdir(parents=True, exist_ok=True)
        listed.write_text("".join(f"{name}\n" for name in sorted({report.nodeid.split("::")[0] for report in skipped})))
    allowed = session.config.option.skip_only
    if allowed is not None and not {_reason(report) for report in skipped} <= set(allowed.split(",")):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _reason(report: pytest.TestReport) -> str:
    """Return why a test was skipped: the command that installs what it needs, where it says one."""
    return report.longrepr[2].removeprefix("Skipped: ").removeprefix(NEEDS)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    counts = Counter(_reason(report) for report in _skipped(config))
    if counts:
        terminalreporter.write_line(f"skipped: {', '.join(f'{n} for {what}' for what, n in counts.most_common())}")
