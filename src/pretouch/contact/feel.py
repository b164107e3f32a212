"""What is felt in one step, by whichever detector the profile names."""

import math

import numpy as np

from pretouch.contact.cues import Cues, no_cues
from pretouch.contact.detect import Detection, detect
from pretouch.contact.fixed import force_map, share_of_band, share_of_bounds
from pretouch.contact.localisation.localise import LocalisationState, localisation_init, localise
from pretouch.contact.localisation.significance import clearest_mean
from pretouch.contact.residual_model import ResidualModel
from pretouch.contact.sequential_detector import Observation, SequentialState, sequential_init, sequential_step
from pretouch.contact.window import WindowState, window_init
from pretouch.params import Profile
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.types import NOT_TOUCHED, Contact, FloatArray, Obstacles, RobotState, Thresholds, Touched
from pretouch.values import value


@value
class FeelState:
    """All that detection remembers from one step to the next."""

    window: WindowState
    """Of the force, eq. 8."""
    sequential: tuple[SequentialState, ...]
    """Of that detector, one; none unless the profile's method is that."""
    where: tuple[LocalisationState, ...] = ()
    """Of the place of a contact, one; none unless the profile localises."""


def feel_init(model: RobotModel, profile: Profile, learnt: ResidualModel | None = None) -> FeelState:
    """Return the state before the first sample of an arm; `learnt` is its free motion as an earlier session left it."""
    p = profile.detection
    sequential = (sequential_init(model, p, learnt),) if p.method == "sequential" else ()
    where = (localisation_init(),) if sequential and p.localise else ()
    return FeelState(window_init(profile.threshold.window_samples), sequential, where)


def learnt(state: FeelState) -> ResidualModel | None:
    """Return what was learnt of free motion, to be kept for the next session; None of a detector that learns none."""
    return state.sequential[0].model if state.sequential else None


def feel(
    state: FeelState, model: RobotModel, kin: Kinematics, robot: RobotState, obstacles: Obstacles, reacting: bool,
    profile: Profile, watched: bool = True, cues: Cues | None = None,
) -> tuple[Detection, FeelState]:  # fmt: skip
    """Take in one sample of what the robot feels, and say whether it is a contact.

    Args:
        state: memory.
        model: the arm.
        kin: its posture.
        robot: its state, with the estimates of external torques and force.
        obstacles: what is near.
        reacting: whether the arm moves with a contact.
        profile: parameters.
        watched: whether a skin watches, all of its units heard: else nothing is learnt of free motion.
        cues: what units say of a touch, for the method sequential; None for nothing. While a place is said to be
            touched, nothing is learnt of free motion.
    """
    p, force = profile.detection, None if robot.wrench is None else robot.wrench[:3]
    found, window = detect(state.window, force, kin.position[model.ee], obstacles, profile.threshold)
    if reacting and p.freeze_while_reacting:
        window = state.window
    if p.method == "thresholds":
        compared = window.newest if profile.threshold.compare == "filtered" else force
        evidence = 0.0 if force is None or compared is None else share_of_band(compared, found.thresholds.parts)
        return Detection(found.thresholds, found.contact, found.armed, robot.tau_ext, evidence), FeelState(window, ())
    if math.isnan(robot.tau_ext.sum()):
        nothing = Detection(_no_bands(), None, False, np.full(model.n, np.nan), 0.0)
        return nothing, FeelState(window, state.sequential, (localisation_init(),) if state.where else ())
    if p.method == "fixed":
        felt_force = force_map(model.ee_jacobian(kin)) @ robot.tau_ext if force is None else force
        share = share_of_bounds(robot.tau_ext, force, p)
        bands = _bands(np.full(3, p.force_n))
        contact = _contact(felt_force, bands) if share >= 1.0 and found.armed else None
        return Detection(bands, contact, found.armed, robot.tau_ext, share), FeelState(window, ())
    before = state.sequential[0] if state.sequential else sequential_init(model, p)
    told, period = no_cues(len(model.links)) if cues is None else cues, profile.task.control_period_s
    alone = watched and not len(told.link)
    seen = Observation(kin, robot, obstacles, told)
    felt, after = sequential_step(before, model, seen, reacting, alone, period, p)
    bands = Thresholds(felt.bands)
    contact = _contact(felt.force, bands) if felt.detected and found.armed else None
    touched: Touched = NOT_TOUCHED
    where: tuple[LocalisationState, ...] = ()
    if p.localise:
        touched, following = localise(
            state.where[0] if state.where else localisation_init(), model, seen, felt.windows,
            felt.log_likelihood_ratio, period, profile.localisation,
        )  # fmt: skip
        where = (following,)
    clear = None
    if profile.reaction.pinches and felt.log_likelihood_ratio >= 1.0:
        clear = clearest_mean(felt.windows, period, profile.localisation)
    made = Detection(
        bands, contact, found.armed, felt.residual, felt.log_likelihood_ratio, felt.learning, felt.lasting, touched,
        clear,
    )  # fmt: skip
    return made, FeelState(window, (after,), where)


def _contact(force: FloatArray, bands: Thresholds) -> Contact:
    """Return a contact with the axes whose equivalent band is passed, or else the one with the largest part."""
    share = np.abs(force) / (bands.upper - bands.mean)
    return Contact(force, share >= min(1.0, float(share.max())))


def _bands(band: FloatArray) -> Thresholds:
    """Bands (3,) about no force, of a spread that nobody knows."""
    none = np.zeros(3)
    return Thresholds(np.array([band, -band, none, np.full(3, np.nan), none, none]))


def _no_bands() -> Thresholds:
    return Thresholds(np.full((6, 3), np.nan))
