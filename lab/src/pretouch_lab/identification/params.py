"""What identification takes for granted, and what it keeps where a recording cannot tell."""

from dataclasses import dataclass

from pretouch.checks import Checked, NonNegative, Positive
from pretouch.sim.plant_params import PlantParams

Joints = tuple[float, ...]


@dataclass(frozen=True)
class Usual:
    """The simulated arm as it is without a recording: n joints, fields as those of the plant."""

    friction_f1_nm: Joints
    friction_f2_s_rad: Joints
    friction_f3_rad_s: Joints
    friction_compensated: float
    ripple_cycles: Joints
    torque_noise_hz: float
    """Corner frequency of the torque sensors' noise [Hz]; the observer hides it."""
    observer_gain_1_s: float
    period_s: float
    """Of the observer [s]."""


def usual_of(plant: PlantParams) -> Usual:
    """Return what of a plant identification takes for granted."""
    return Usual(
        plant.friction_f1_nm, plant.friction_f2_s_rad, plant.friction_f3_rad_s, plant.friction_compensated,
        plant.ripple_cycles, plant.torque_noise_hz, plant.observer_gain_1_s, plant.period_s,
    )  # fmt: skip


@dataclass(frozen=True)
class IdentifyParams(Checked):
    """Numbers of the fit."""

    tails: Positive = 5.0
    """Degrees of freedom of the Student distribution of what is left [1]: an outlier counts little."""
    block_s: Positive = 1.0
    """Length of the blocks that are taken as independent [s]: ten times what an observer remembers, and more."""
    offset_prior_nm: Positive = 3.0
    """Standard deviation of an offset before anything is known [Nm]; wide."""
    friction_prior_nm: Positive = 1.0
    """Of the friction that the interface does not compensate [Nm]; wide."""
    steepness_prior: Positive = 0.5
    """Of the logarithm of F2 about the usual one [1]."""
    asymmetry_prior_rad_s: Positive = 0.04
    """Of F3 about the usual one [rad/s]."""
    ripple_prior_nm: Positive = 0.5
    """Of each part of a joint's ripple [Nm]."""
    mass_prior: Positive = 0.1
    """Of the relative error of each link's mass [1]."""
    payload_prior_kg: Positive = 0.5
    """Of the unknown payload [kg]."""
    known_share: Positive = 0.5
    """A number is identified where its standard error is below this part of what was known before [1]."""
    contact_sigmas: Positive = 6.0
    """A mean over `contact_s` this many of its own robust deviations off is taken for a contact [1]."""
    contact_s: Positive = 0.15
    """[s]"""
    contact_margin_s: NonNegative = 0.5
    """What is left out before and after it as well [s]."""
    contact_share: Positive = 0.3
    """Of a recording in which more than this looks like contacts nothing is identified [1]."""
