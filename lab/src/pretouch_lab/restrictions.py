"""Restriction modes: what trials call the ways to restrict the arm's approach. Each is a change of a profile's text."""

from typing import get_args

from pretouch.composition import changed
from pretouch.control.approach import ApproachRestriction, Restriction
from pretouch.errors import ParameterError
from pretouch.params import RowKind
from pretouch.profiles import Profile


def modes() -> dict[str, dict[str, str]]:
    """Return what each mode changes of a profile: none, the rows of the paper's restriction, and other parts."""
    rows = {kind: {"approach": ApproachRestriction.name, "approach.rows": kind} for kind in get_args(RowKind)}
    parts = {name: {"approach": name} for name in Restriction.choices() if name != ApproachRestriction.name}
    return {"off": {"approach": "none"}} | rows | parts


def mode_of(profile: Profile) -> str:
    """Return the mode of a profile."""
    part = profile.approach
    return "off" if part is None else part.rows if isinstance(part, ApproachRestriction) else part.name


def with_mode(profile: Profile, mode: str) -> Profile:
    """Return a profile in another mode; a part that stays keeps its parameters."""
    known = modes()
    if mode not in known:
        raise ParameterError(f"The restriction {mode!r} is unknown: choose from {', '.join(known)}.")
    return changed(profile, known[mode])
