"""How well three simulators tell a push of 15 N on each link: their `tau_ext_hat_filtered` beside the truth.

    unshare --net --mount sh -c 'ip link set lo up; exec python -m fci.programs.forces \
        pretouch=/path/to/python franka_sim=/path/to/python franky_sim=/path/to/python'

Each interpreter is one that has that simulator. The arm stands at its start, without a motion; the client is
pylibfranka. Truth and errors are norms over the joints [Nm], means over pushes along x, y and z. `error` is of the
torques that are told, `change` of what a push changes of them. A sign is the simulator's own: the better one counts.
"""

import argparse
import subprocess
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

PUSH_N = 15.0
_SETTLES_S, _LASTS_S, _READ_S = 6.0, 2.0, 0.5
"""How long the arm stands first, how long a push lasts before it is looked at, and how long it is looked at [s]."""
_FOLDER = Path(__file__).parent / "pushed"
_SIMULATORS = sorted(file.stem.removesuffix("_server") for file in _FOLDER.glob("*_server.py"))


def _interpreter(pair: str) -> tuple[str, str]:
    """Return a simulator and its interpreter, of NAME=PYTHON."""
    name, _, python = pair.partition("=")
    if name not in _SIMULATORS or not Path(python).is_file():
        raise argparse.ArgumentTypeError(
            f"{pair}: give {' or '.join(f'{name}=PYTHON' for name in _SIMULATORS)}, with a path that exists"
        )
    return name, python


def main() -> None:
    """Push every link along every axis, in each simulator."""
    parser = argparse.ArgumentParser(prog="python -m fci.programs.forces", description=(__doc__ or "").splitlines()[0])
    metavar, words = "NAME=PYTHON", "a simulator, and an interpreter that has it"
    parser.add_argument("simulators", nargs="+", type=_interpreter, metavar=metavar, help=words)
    simulators = parser.parse_args().simulators
    if find_spec("pylibfranka") is None:
        raise SystemExit("The client needs pylibfranka of the extra 'franka': run make franka.")
    print("| simulator | link | truth | error | change | force [N] |\n| --- | --- | --- | --- | --- | --- |")
    for name, python in simulators:
        with subprocess.Popen(  # noqa: S603  our own script
            [python, str(_FOLDER / f"{name}_server.py")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as server:
            try:
                _measure(name, server)
            finally:
                server.kill()


def _measure(name: str, server: subprocess.Popen[str]) -> None:
    import pylibfranka  # the help does without

    assert server.stdin is not None  # noqa: S101  pipes, as asked for
    assert server.stdout is not None  # noqa: S101
    while server.stdout.readline().strip() != "ready":
        if server.poll() is not None:
            raise SystemExit(f"{name}: its server has ended.")
    time.sleep(_SETTLES_S)
    robot = pylibfranka.Robot("127.0.0.1", pylibfranka.RealtimeConfig.kIgnore)
    truth, told, forces = np.zeros((8, 3, 7)), np.zeros((8, 3, 7)), np.zeros((8, 3, 3))
    for link in range(8):  # the last without a push
        for axis in range(3):
            force = PUSH_N * (np.arange(3) == axis) * (link < 7)
            server.stdin.write(f"{link % 7} {' '.join(map(str, force))}\n")
            server.stdin.flush()
            truth[link, axis] = np.array(server.stdout.readline().split(), dtype=float)
            told[link, axis], forces[link, axis] = _read(robot)
    sign = min((1.0, -1.0), key=lambda s: float(np.linalg.norm(s * told - truth)))
    for link in range(8):
        error = sign * told[link] - truth[link]
        change = error - sign * told[7].mean(axis=0)
        sizes = " | ".join(f"{np.linalg.norm(each, axis=1).mean():.2f}" for each in (truth[link], error, change))
        at, most = f"{link + 1}" if link < 7 else "none", np.linalg.norm(forces[link], axis=1).mean()
        print(f"| {name} | {at} | {sizes} | {most:.1f} |", flush=True)


def _read(robot: Any) -> tuple[np.ndarray, np.ndarray]:
    """Let a push last, then take the means of what the robot tells: torques (7,) [Nm] and force (3,) [N]."""
    time.sleep(_LASTS_S)
    until, torques, forces = time.monotonic() + _READ_S, [], []
    while time.monotonic() < until:
        state = robot.read_once()
        torques.append(state.tau_ext_hat_filtered)
        forces.append(state.O_F_ext_hat_K[:3])
    return np.mean(torques, axis=0), np.mean(forces, axis=0)


if __name__ == "__main__":
    main()
