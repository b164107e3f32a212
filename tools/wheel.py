"""Build a wheel with machine code, so that an installation compiles nothing: `python -m tools.wheel`.

The code is Numba's own cache, for one Python, one Numba and processors of the level `compiled.LEVEL`. With another
Numba or processor the first start compiles, as in a clone, and prints that it does.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

from pretouch.compiled import LEVEL

ROOT = Path(__file__).parents[1]


def build(folder: Path) -> Path:
    """Build it in a folder; return the file."""
    shutil.rmtree(folder, ignore_errors=True)
    run = lambda *words, **env: subprocess.run(words, cwd=folder, env=os.environ | env, check=True)  # noqa: E731
    folder.mkdir(parents=True)
    run(sys.executable, "-m", "venv", "user")
    python = str(folder / "user/bin/python")
    run(python, "-m", "pip", "wheel", "-q", "--no-deps", "-w", "plain", str(ROOT))
    (plain,) = (folder / "plain").iterdir()
    run(python, "-m", "pip", "install", "-q", "-c", str(ROOT / "constraints.txt"), "wheel", str(plain))
    run(str(folder / "user/bin/pretouch"), "warm-up", NUMBA_CPU_NAME=LEVEL, NUMBA_CPU_FEATURES="")
    run(python, "-m", "wheel", "unpack", "-d", "parts", str(plain))
    (parts,) = (folder / "parts").iterdir()
    (folder / "whole").mkdir()
    installed = Path(sysconfig.get_path("purelib", vars={"base": str(folder / "user")}))
    for file in installed.glob("pretouch/**/*.nb[ci]"):
        if "-within-" not in file.name:  # those are for what calls them, which is compiled
            to = parts / file.relative_to(installed)
            to.parent.mkdir(exist_ok=True)
            shutil.copy(file, to)
    run(python, "-m", "wheel", "pack", "-d", "whole", str(parts))
    (whole,) = (folder / "whole").iterdir()
    tag, platform = f"cp{sys.version_info.major}{sys.version_info.minor}", sysconfig.get_platform().replace("-", "_")
    tags = ("--python-tag", tag, "--abi-tag", tag, "--platform-tag", platform)
    run(python, "-m", "wheel", "tags", "--remove", *tags, str(whole))
    (tagged,) = (folder / "whole").iterdir()
    return tagged


if __name__ == "__main__":
    print(build(ROOT / "build/wheel"))
