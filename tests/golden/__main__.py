"""Compare this checkout with another commit bit for bit: `python -m tests.golden COMMIT`.

Both run their own copy of `tests/golden` on this machine, each with its own source. Whatever is renamed or taken away
on purpose is left out by `--without NAME`, of an input or of a field.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from tests.golden.kept import Steps, equal, first_difference, read, summary

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "build" / "golden"


def main(arguments: list[str] | None = None) -> int:
    """Return 0 if all steps are equal, 1 if some differ, 2 if they cannot be compared."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("base", help="commit to compare with")
    parser.add_argument("--without", action="append", default=[], help="input or field that is not compared")
    given = parser.parse_args(arguments)
    with checked_out(given.base) as base:
        if base is None:
            print(f"There is no commit {given.base!r}: name one that this repository has.")
            return 2
        if not (base / "tests" / "golden" / "produce.py").exists():
            print(f"The commit {given.base} has no tests/golden/produce.py: compare with one that has.")
            return 2
        files = FOLDER / "base.npz", FOLDER / "here.npz"
        running = [begun(root, file) for root, file in zip((base, ROOT), files, strict=True)]
        failed = [process.wait() for process in running]
        if any(failed):
            print("The steps could not be made: see above.")
            return 2
    return judged(*map(read, files), given.base, set(given.without))


def judged(base: Steps, here: Steps, name: str, without: set[str]) -> int:
    """Print how two sets of steps compare; return the exit status."""
    base, here = (left(steps, without) for steps in (base, here))
    said = first_difference(base, here, equal, (name, "this checkout"))
    print(said or f"{summary(here)}: equal.")
    return int(bool(said))


def left(steps: Steps, without: set[str]) -> Steps:
    """Leave inputs and fields out."""
    return {
        name: {
            i: {field: value for field, value in values.items() if field not in without}
            for i, values in cycles.items()
        }
        for name, cycles in steps.items()
        if name not in without
    }  # fmt: skip


@contextmanager
def checked_out(commit: str) -> Iterator[Path | None]:
    """Check a commit out for as long as the context lasts; None if there is no such commit."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=FOLDER) as folder:
        place = Path(folder) / "base"
        if git("worktree", "add", "--quiet", "--detach", str(place), commit):
            yield None
            return
        try:
            yield place
        finally:
            git("worktree", "remove", "--force", str(place))


def git(*words: str) -> int:
    """Run git in this checkout; return its exit status."""
    return subprocess.run([which("git") or "git", *words], cwd=ROOT).returncode


def begun(root: Path, file: Path) -> subprocess.Popen[bytes]:
    """Begin to run a checkout's own copy of the producing script, with the checkout's own source."""
    file.unlink(missing_ok=True)
    env = {**os.environ, "PYTHONPATH": f"{root / 'src'}{os.pathsep}{root}"}
    return subprocess.Popen([sys.executable, "-m", "tests.golden.produce", file], cwd=root, env=env)


if __name__ == "__main__":
    sys.exit(main())
