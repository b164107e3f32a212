"""What decisions on an imported recording say about the arm's force signal and the profile's thresholds."""

import numpy as np

from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.imported_data.samples import ImportedData
from pretouch.profiles import Profile
from pretouch.recording.compare import Decisions
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

_BEFORE_S = 0.5
"""Time before a contact [s] that may belong to it already."""
_SLOWER = 0.95
"""Share of the detector's rate below which data count as slower."""


@value
class Summary:
    """How a detector fared. Forces in N, base frame."""

    duration: float
    """Time in which the detector was armed [s]."""
    free: float
    """Part of it outside contacts and reactions [s]."""
    mean: FloatArray
    """(3,) of the force in free motion, NaN without any."""
    sigma: FloatArray
    """(3,) standard deviation of the force in free motion."""
    sigma_window: FloatArray
    """(3,) median of that within the window in free motion, after eq. 8."""
    width: FloatArray
    """(3,) median distance of a threshold from the mean between both in free motion."""
    f_base_free: float
    """F_b above which the free motion would hold no contact."""
    f_base_all: float
    """F_b above which the whole recording would hold none."""


def summary(decisions: Decisions, profile: Profile) -> Summary:
    """Sum decisions up."""
    d, period = decisions, profile.task.control_period_s
    judged = d.armed & np.isfinite(d.compared).all(axis=1)
    free = judged & ~d.reacting & ~_before(d)
    beyond = np.maximum(d.compared - d.upper, d.lower - d.compared).max(axis=1)
    nothing = np.full(3, np.nan)
    some = bool(free.any())
    return Summary(
        duration=float(judged.sum() * period),
        free=float(free.sum() * period),
        mean=d.force[free].mean(axis=0) if some else nothing,
        sigma=d.force[free].std(axis=0) if some else nothing,
        sigma_window=np.median(d.sigma[free], axis=0) if some else nothing,
        width=np.median((d.upper - d.lower)[free] / 2, axis=0) if some else nothing,
        f_base_free=thresholds_of(profile.detect).f_base_n + float(beyond[free].max()) if some else np.nan,
        f_base_all=thresholds_of(profile.detect).f_base_n + float(beyond[judged].max()) if judged.any() else np.nan,
    )


def _before(d: Decisions) -> BoolArray:
    """Cycles (S,) shortly before a contact."""
    found = np.zeros(len(d.time), dtype=np.bool_)
    for contact in d.contacts:
        found |= (d.time <= contact.time) & (d.time > contact.time - _BEFORE_S)
    return found


def guidance(decisions: Decisions, found: Summary, profile: Profile) -> str:
    """Say what the contacts mean for an arm that nobody touched."""
    count, minutes = len(decisions.contacts), found.duration / 60
    if not count:
        return (
            f"{decisions.name}: no contact in {minutes:.1f} min; an F_b below {found.f_base_all:.1f} N would have given"
            f" one (F_b is {thresholds_of(profile.detect).f_base_n:g} N)."
        )
    contacts = "1 false contact" if count == 1 else f"{count} false contacts"
    return (
        f"{decisions.name}: if nobody touched the arm, {contacts} in {minutes:.1f} min; an F_b above"
        f" {found.f_base_all:.1f} N would have given none, one above {found.f_base_free:.1f} N none but"
        f" {'this' if count == 1 else 'these'} (it is {thresholds_of(profile.detect).f_base_n:g} N)."
    )


def findings(imported: ImportedData, decisions: Decisions, profile: Profile) -> tuple[str, ...]:
    """Say what to know of the data with this detector: their rate, and the gaps in them."""
    rate, own = imported.rate, 1 / profile.task.control_period_s
    said = []
    if rate < _SLOWER * own:
        said.append(
            f"The force comes at {rate:.4g} Hz and the detector of {profile.name} runs at {own:.4g} Hz: repeated"
            f" samples lower sigma; --rate {rate:.4g} runs it at the data's own rate."
        )
    gaps = np.diff(imported.force.time) / 1e9
    long = gaps[gaps > profile.failure.force_timeout_s]
    if len(long):
        many = f"{len(long)} gaps" if len(long) > 1 else "A gap"
        said.append(
            f"{many} of more than {profile.failure.force_timeout_s:g} s, {long.sum():.2f} s in all, without force."
        )
    without = int(np.count_nonzero(~np.isfinite(decisions.force).all(axis=1)))
    if without:
        said.append(
            f"{decisions.name}: {without} of {len(decisions.time)} cycles have no force, so nothing is detected in"
            " them."
        )
    return tuple(said)
