"""What is installed on demand: the extras of this distribution, and what is said where one is missing."""

from importlib.util import find_spec

from pretouch.errors import MissingExtraError

EXTRAS = {
    "figures": ("matplotlib",),
    "bags": ("rosbags",),
    "ros2": ("cyclonedds", "rosbags"),
}
"""Modules of each extra."""


def need(extra: str, what: str) -> None:
    """Raise MissingExtraError where an extra is not installed; `what` needs it, as "Figures"."""
    missing = [module for module in EXTRAS[extra] if find_spec(module) is None]
    if missing:
        raise MissingExtraError(
            f"{what} need the extra '{extra}', and {' and '.join(missing)} cannot be imported:"
            f" pip install 'pretouch[{extra}]'."
        )
