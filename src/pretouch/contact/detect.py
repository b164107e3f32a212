"""Contact detection in one call: force in, thresholds and perhaps a contact out."""

from dataclasses import field
from typing import NamedTuple

import numpy as np

from pretouch.compiled import entry
from pretouch.contact.reaction import external_force
from pretouch.contact.thresholds import ThresholdNumbers, crossed, side_distances, threshold_parts
from pretouch.contact.window import WindowState, add_to, added, place, window_mean, window_std
from pretouch.params import ThresholdParams
from pretouch.types import Contact, FloatArray, Obstacles, Thresholds, Touched, untouched
from pretouch.values import value


@value
class Detection:
    """What one step found about the external force."""

    thresholds: Thresholds
    contact: Contact | None
    armed: bool
    """Whether the window was full before this sample."""
    residual: FloatArray
    """(n,) external joint torques less what the detector takes for free motion [Nm]; NaN without torques."""
    evidence: float
    """How far the test is on the way to a contact: one from 1 on, while armed."""
    learning: bool = False
    """Whether the sample is to be learnt as free motion."""
    lasting: bool = False
    """Whether it is being found out if what is felt is a load or an error of the estimate: the arm waits for that."""
    touched: Touched = field(default_factory=untouched)
    """Where the arm is touched; empty where nothing is felt or the profile does not localise."""
    clear: tuple[FloatArray, FloatArray] | None = None
    """Residual (n,), averaged over the time in which it stands out most [Nm], and the covariance (n, n) that it has in
    free motion [Nm^2]; where something caught is looked for and something is felt."""


def detect(
    state: WindowState,
    force: FloatArray | None,
    ee_position: FloatArray,
    obstacles: Obstacles,
    params: ThresholdParams,
) -> tuple[Detection, WindowState]:
    """Add a force sample to the window (eq. 8), move the thresholds (eqs. 9-11) and hold the sample against them.

    Mean and deviation are those of the window with the newest value in it. Without an estimate (`force` None) the
    window stays as it is and nothing is detected. Nothing is detected either before the window is full. Residual and
    evidence are for `feel` to fill in.
    """
    armed, p, parts = state.full, params, np.empty((6, 3))
    chunk, at, sums = place(state)
    found = _detect.flat(
        chunk, at, sums, state.count, armed,
        force is not None, _NONE if force is None else force, p.compare == "filtered",
        ee_position, obstacles.point, obstacles.ee_distance,
        p.alpha, p.lambda_, p.f_base_n, p.f_std_n, p.sigma_max_n, p.f_d_n, p.d_max_m, p.d_min_m, parts,
    )  # fmt: skip
    after = state if force is None else added(state, chunk, sums)
    limits, contact = Thresholds(parts), None
    if force is not None and found and armed:
        compared = after.newest if p.compare == "filtered" else force
        contact = Contact(external_force(compared, limits.mean), crossed(compared, limits))
    return Detection(limits, contact, armed, _NONE, 0.0), after


_NONE = np.full(3, np.nan)


class _Window(NamedTuple):
    """What one more value changes of a window, see `place`."""

    chunk: FloatArray
    at: int
    sums: FloatArray
    held: int
    """How many values the window holds."""
    full: bool


class _Force(NamedTuple):
    """What is held against the thresholds."""

    present: bool
    """Whether there is an estimate."""
    value: FloatArray
    """(3,) [N], without meaning if not."""
    filtered: bool
    """Whether it is compared as it enters the window (eq. 8), or as it is."""


class _Near(NamedTuple):
    """As of `Obstacles`."""

    point: FloatArray
    ee_distance: FloatArray


@entry
def _detect(
    window: _Window, force: _Force, ee_position: FloatArray, obstacles: _Near, p: ThresholdNumbers,
    parts: FloatArray,
) -> bool:  # fmt: skip
    """Add to the window, write the thresholds (6, 3), and say whether the force crosses one of them."""
    chunk, at, sums, held, full = window
    if force.present:
        add_to(chunk, at, sums, held, full, force.value, p.alpha, p.lambda_)
        held = held if full else held + 1
    mean = window_mean(sums, held)
    positive, negative = side_distances(ee_position, obstacles.point, obstacles.ee_distance)
    threshold_parts(mean, window_std(sums, held), positive, negative, p, parts)
    if not force.present:
        return False
    found = False
    for i in range(3):
        compared = sums[0, i] if force.filtered else force.value[i]
        found = found or compared > parts[0, i] or compared < parts[1, i]
    return found
