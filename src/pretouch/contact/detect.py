"""Contact detection in one call: force in, thresholds and perhaps a contact out."""

from dataclasses import dataclass

import numpy as np

from pretouch.contact.reaction import external_force
from pretouch.contact.thresholds import crossed, side_distances, thresholds
from pretouch.contact.window import WindowState, add
from pretouch.params import ThresholdParams
from pretouch.types import Contact, FloatArray, Obstacles, Thresholds


@dataclass(frozen=True, slots=True)
class Detection:
    """What one step found about the external force."""

    thresholds: Thresholds
    contact: Contact | None
    armed: bool
    """Whether the window was full before this sample."""


def detect(
    state: WindowState,
    force: FloatArray | None,
    ee_position: FloatArray,
    obstacles: Obstacles,
    params: ThresholdParams,
) -> tuple[Detection, WindowState]:
    """Add a force sample to the window (eq. 8), move the thresholds (eqs. 9-11) and hold the sample against them.

    Mean and deviation are those of the window with the newest value in it. Without an estimate (`force` None) the
    window stays as it is and nothing is detected. Nothing is detected either before the window is full.
    """
    armed = state.full
    if force is not None:
        state = add(state, force, params.alpha, params.lambda_)
    mean = state.mean()
    positive, negative = side_distances(ee_position, obstacles.point, obstacles.ee_distance)
    limits = thresholds(mean, state.std(), positive, negative, params)
    if force is None or not armed:
        return Detection(limits, None, armed), state
    compared = state.newest if params.compare == "filtered" else force
    axes = crossed(compared, limits)
    contact = Contact(external_force(compared, mean), axes) if np.any(axes) else None
    return Detection(limits, contact, armed), state
