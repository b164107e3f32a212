"""What stands between a commander and the arm."""

from pretouch.profiles import Profile, profile
from pretouch_lab.baselines.cbf import CBF, CBF_PROFILE

FILTERS: dict[str, Profile] = {
    "pretouch": profile("pretouch"),
    "paper": profile("paper"),
    "cbf": CBF_PROFILE,
    "none": profile("pretouch:approach=none:null_space=none"),
}
"""`none` sees what `pretouch` does, answers contacts as it does, and keeps the limits of the joints alone."""


def filters() -> tuple[str, ...]:
    """Return the names of those that can run here."""
    return tuple(name for name in FILTERS if name != "cbf" or not CBF.missing())


def left_out() -> str:
    """Say what cannot run here, and what would change that; '' for nothing."""
    return f"The filter cbf was left out, for its extra is not installed: run {CBF.command}" if CBF.missing() else ""
