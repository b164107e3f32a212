"""Parameters of the admittance: yielding to a contact, clamps, and when to give up (docs/explanation/reaction.md)."""

from dataclasses import dataclass

from pretouch.checks import Checked, NonNegative, Positive, PositiveCount


@dataclass(frozen=True)
class ClampParams(Checked):
    """Being caught between two objects while the arm yields, and how the arm opens."""

    torque_nm: Positive = 4.0
    """Torque against the direction of yielding from which the arm is caught between two objects [Nm]: four times the
    noise of a Panda's estimate, about 8 N on the hand."""
    open_m_s: Positive = 0.1
    """Speed of the fastest point of the body while the arm opens along the path it came [m/s]."""
    open_s: Positive = 0.5
    """Longest that it opens [s]."""


@dataclass(frozen=True)
class PinchParams(Checked):
    """Something caught between two of the arm's links, or between one and a fixture: the arm opens and holds.

    It needs the sequential detector; fixtures, localisation too.
    """

    gap_m: Positive = 0.2
    """Gap in which something can be caught [m]: a thigh fits in no larger one."""
    force_n: Positive = 30.0
    """Force from which something is caught [N]: a step of 2 Nm in one joint's estimate looks like 20 N with the lever
    that forearm and upper arm have about the elbow. Less is a push, and opens the joint as well."""


@dataclass(frozen=True)
class GiveUpParams(Checked):
    """Giving up where the arm meets the same object again and again."""

    contacts: PositiveCount = 3
    """Contacts at one place of the path after which it gives up."""
    push_j: Positive = 0.3
    """Energy that a contact gives an arm that stands, from which it is a push and counts for no place [J]: boards met
    at touch speed gave 0.05 J at most, at 0.3 m/s unbraked 0.5 J, pushes of 15 to 30 N for 0.3 s at least 0.59 J
    (docs/explanation/reaction.md). To an arm that moves it may give twice its kinetic energy more."""
    retry_s: Positive = 30.0
    """Time after which it tries again if no unit saw anything there [s]."""


@dataclass(frozen=True)
class AdmittanceParams(Checked):
    """A virtual mass and damper in each joint that an external torque moves as long as it lasts."""

    speed_max_m_s: Positive = 0.3
    """Bound on the speed of every point of the body's axes [m/s] (authors' code family, there of the hand)."""
    reach_m: Positive = 0.3
    """How far a contact may move any point of the body's axes from where it was when the contact began [m]: as far as
    the paper's reaction goes at most, so that the same room has to be free about the arm."""
    inertia_kg_m2: Positive = 1.5
    """Virtual inertia of each joint [kg m^2]: with the damping, 0.1 s to come to rest."""
    damping_nm_s: Positive = 15.0
    """Virtual damping of each joint [Nm s/rad]: 15 N on the hand at 0.5 m from the axis give about 0.2 m/s."""
    lag_s: NonNegative = 0.0167
    """Time constant of the robot's force estimate [s], 0 for none (a Panda's: about 10 Hz). Known, a force that has
    ended no longer drives the arm while its estimate decays."""
    dead_band_nm: NonNegative = 0.5
    """External torque of a joint that moves nothing [Nm]: friction of the smaller joints that the robot does not know.
    """
    dead_band_fraction: NonNegative = 0.02
    """What is added to it, as a fraction of the joint's torque limit: twice the noise of a Panda's larger joints."""
    static_friction_nm: NonNegative = 0.0
    """Filtered torque that tears a joint loose which stands [Nm], 0 for none (3 in `pretouch`): a bias of 2 Nm and
    five deviations of a Panda's filtered noise. 15 N move the arm where they have a lever of 0.2 m."""
    start_energy_j: NonNegative = 0.2
    """Kinetic energy of the virtual mass that a contact may begin with, before it has given any [J]."""
    quiet_s: Positive = 1.0
    """Time without a push after which the arm goes on with its task [s]."""
    near_m: NonNegative = 0.1
    """Distance from the body within which something seen makes the arm wait, as a hand that rests on it [m]."""
    patience_s: NonNegative = 10.0
    """Longest that it waits for that [s]."""
    soft_hold: bool = False
    """Whether an arm that holds yields to a push where the cause of the HOLD allows it (`modes.TABLE`)."""
    clamp: ClampParams | None = None
    """What tells that the arm is caught between two objects while it yields; None where it does not look for that."""
    pinch: PinchParams | None = None
    """What tells something caught between links, or a link and a fixture, from a push; None where all is a push."""
    give_up: GiveUpParams | None = None
    """When the arm gives up at a place; None where it never does."""
