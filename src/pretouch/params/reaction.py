"""Parameters of the reaction to a contact: eq. 12's decay, or a passive admittance; clamps, and when to give up."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pretouch.checks import Check, Checked, NonNegative, Positive, PositiveCount


@dataclass(frozen=True)
class ReactionParams(Checked):
    """Moving with the push (eq. 12), or yielding to it as long as it lasts (docs/explanation/reaction.md)."""

    method: Literal["decay", "admittance"] = "decay"
    """`decay`: eq. 12, a velocity set at the onset that decays whatever is felt (paper). `admittance`: a virtual mass
    and damper that the force moves as long as it is felt; the four switches below are only of it."""
    compliance_m_s_n: Positive = 0.03
    """Diagonal of the compliance matrix C [(m/s)/N] (authors' code family)."""
    speed_max_m_s: Positive = 0.3
    """Bound on the norm of the reaction velocity [m/s] (authors' code family, there per axis); in the admittance on the
    speed of every point of the body's axes."""
    decay_cycles: PositiveCount = 200
    """Control cycles in which the reaction decays linearly to zero. Shorter than the window, the release of a
    push is taken for a new contact."""
    clamps: bool = False
    """Switch: whether the arm looks for being caught between two things while it yields."""
    gives_up: bool = False
    """Switch: whether it gives up where it meets the same thing again and again."""
    soft_hold: bool = False
    """Switch: whether an arm that holds yields to a push where the cause of the HOLD allows it (`modes.TABLE`)."""
    lag_s: NonNegative = 0.0167
    """Switch: time constant of the robot's force estimate [s], 0 for none (a Panda's: about 10 Hz). Known, a force that
    has ended no longer drives the arm while its estimate decays."""
    inertia_kg_m2: Positive = 1.5
    """Virtual inertia of each joint [kg m^2]: with the damping, 0.1 s to come to rest."""
    damping_nm_s: Positive = 15.0
    """Virtual damping of each joint [Nm s/rad]: 15 N on the hand at 0.5 m from the axis give about 0.2 m/s."""
    dead_band_nm: NonNegative = 0.5
    """External torque of a joint that moves nothing [Nm]: friction of the smaller joints that the robot does not know.
    """
    dead_band_fraction: NonNegative = 0.02
    """What is added to it, as a fraction of the joint's torque limit: twice the noise of a Panda's larger joints."""
    static_friction_nm: NonNegative = 0.0
    """Switch: filtered torque that tears a joint loose which stands [Nm], 0 for none (ours, 3 in `pretouch`): a bias of
    2 Nm and five deviations of a Panda's filtered noise. 15 N move the arm where they have a lever of 0.2 m."""
    reverse_band: Annotated[float, Check(low=1.0)] = 2.0
    """Factor on the dead band of a joint for torques against the push it has just yielded to: what the release of a
    push leaves in the estimate must not pull the arm towards the person."""
    start_energy_j: NonNegative = 0.2
    """Kinetic energy of the virtual mass that a contact may begin with, before it has given any [J]."""
    tank_max_j: Positive = 2.0
    """Most of the energy taken from a push that is kept to be given back [J]."""
    mean_s: Positive = 0.5
    """Time constant of each of the two filters whose output is the mean torque in free motion [s]."""
    quiet_s: Positive = 1.0
    """Time without a push after which the arm goes on with its task [s]."""
    near_m: NonNegative = 0.1
    """Distance from the body within which something seen makes the arm wait, as a hand that rests on it [m]."""
    patience_s: NonNegative = 10.0
    """Longest that it waits for that [s]."""
    clamp_nm: Positive = 4.0
    """Torque against the way the arm yields from which it is caught between two things [Nm]: four times the noise of a
    Panda's estimate, about 8 N on the hand."""
    clamp_s: Positive = 0.03
    """Time for which a torque must oppose the yielding to be a clamp [s]."""
    clamp_window_s: Positive = 0.25
    """Time after a push in which what opposes the yielding is a clamp and no push of its own [s]."""
    clamp_turns: PositiveCount = 2
    """Reversals of the yielding, less than `turn_s` apart, that leave no way out and are a clamp too."""
    turn_s: Positive = 2.0
    """See `clamp_turns` [s]."""
    open_m_s: Positive = 0.1
    """Speed of the fastest point of the body while the arm opens along the way it came [m/s]."""
    open_s: Positive = 0.5
    """Longest that it opens [s]."""
    pinches: bool = False
    """Switch: whether something caught between two of the arm's links, or between one and a fixture, is told from a
    push, so that the arm opens and holds (ours). It needs the sequential detector; fixtures, localisation too."""
    pinch_gap_m: Positive = 0.2
    """Gap in which something can be caught [m]: a thigh fits in no larger one."""
    pinch_least_m: NonNegative = 0.02
    """Gap to a fixture below which the link touches the fixture itself [m]: as well as the place of a contact is known.
    """
    pinch_closing_m_s: Positive = 0.02
    """Speed from which a gap counts as closing [m/s]: two links with a single link between them come nearer to each
    other by less, whatever the arm does."""
    pinch_thickness_m: Positive = 0.06
    """Mean thickness of what may be caught, between finger and forearm [m]: of two gaps that explain the torques as
    well, the narrower one is taken."""
    pinch_n: Positive = 30.0
    """Force from which something is caught [N]: a step of 2 Nm in one joint's estimate looks like 20 N with the lever
    that forearm and upper arm have about the elbow. Less is a push, and opens the joint as well."""
    pinch_along: Annotated[float, Check(low=0.0, high=1.0)] = 0.85
    """Cosine of the largest angle between that force and the shortest way across the gap: friction."""
    pinch_rest: Positive = 9.0
    """Square of the torques that a caught thing may leave unexplained, in deviations of free motion [1]: 94 % of the
    chi-square distribution of the four that a force does not explain."""
    pinch_explained: Positive = 27.0
    """Least square of the torques that it has to explain [1]. Of 297 contacts from outside one met both bounds."""
    give_up_contacts: PositiveCount = 3
    """Contacts at one place of the path after which it gives up."""
    place_m: Positive = 0.1
    """Contacts less than this apart along the path are at one place [m]."""
    pushed_j: Positive = 0.3
    """Energy that a contact gives an arm that stands, from which it is a push and counts for no place [J]: boards met
    at touch speed gave 0.05 J at most, at 0.3 m/s unbraked 0.5 J, pushes of 15 to 30 N for 0.3 s at least 0.59 J
    (docs/explanation/reaction.md). To an arm that moves it may give twice its kinetic energy more."""
    clear_s: Positive = 1.0
    """Time for which nothing is seen near before the arm that gave up tries again [s]."""
    retry_s: Positive = 30.0
    """Time after which it tries again if no unit saw anything there [s]."""
