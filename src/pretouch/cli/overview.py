"""The help of `pretouch` itself: what one needs first on top, the rest in groups, on one screen of 80 columns."""

from collections.abc import Mapping

SHELLS = ("bash", "zsh", "tcsh")
"""Shells that `pretouch completion` writes for."""
GROUPS = {
    "Begin with": {
        "live": "a simulated arm in your browser: reach for it",
        "demo": "the paper's three experiments in small",
        "run": "move an arm: simulated, Franka, or over ROS 2",
    },
    "Recordings": {
        "replay": "view, recompute, or compare with another profile",
        "report": "contacts, forces and distances as one page",
        "detect": "try the contact thresholds on data of your own arm",
    },
    "Arm and skin": {
        "skin": "units: monitor, calibrate, provision, coverage",
        "robot": "import your own arm from URDF or MJCF, and check it",
        "identify": "offsets, friction and noise of an arm",
        "serve-fci": "a simulated Franka for programs that use libfranka",
    },
    "Experiments": {
        "reproduce": "the paper in full, and studies of its claims",
        "figure": "one figure of the paper",
        "bench": "compare detectors, avoidance, forces, step times",
        "sweep": "vary parameters, and see which matter",
    },
    "Setup": {"warm-up": "compile, once after an installation"},
}


def overview(installed: Mapping[str, str]) -> str:
    """Write the help on commands that are installed, each with what to say of one that is in no group."""
    known = {name for group in GROUPS.values() for name in group}
    groups = {title: {n: said for n, said in group.items() if n in installed} for title, group in GROUPS.items()}
    groups["Added"] = {name: said for name, said in installed.items() if name not in known}
    lines = ["usage: pretouch COMMAND [OPTIONS]          options: pretouch COMMAND --help"]
    for title, group in groups.items():
        for i, (name, said) in enumerate(group.items()):
            lines.append(f"{'' if i else title:<13} {name:<10} {said}"[:80])
    return "\n".join([*lines, f'{"":<13} completion by Tab:  eval "$(pretouch completion bash)"'])
