"""The answer to contacts: eq. 12's decay or the admittance, with clamps and places the arm gives up."""

from dataclasses import replace
from typing import Literal

import numpy as np

from pretouch.contact import reaction
from pretouch.contact.admittance import (
    AdmittanceState,
    admittance_init,
    begun,
    dead_band,
    fastest_point,
    learnt,
    yielded,
)
from pretouch.contact.clamp import ClampState, caught_between, clamp_begun, clamp_init, clamped, gone, opened
from pretouch.contact.detect import Detection
from pretouch.contact.repeated_contact import (
    RepeatedContactState,
    count_contact,
    discount_push,
    forget_passed,
    given_up,
    repeated_contact_init,
    wait_to_retry,
)
from pretouch.contact.self_clamping import find_self_clamp, presses_on_fixture
from pretouch.params import Profile, ReactionParams
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.types import FloatArray, Obstacles, RobotState
from pretouch.values import value


@value
class ResponseState:
    """Memory of the answer to contacts."""

    decay: reaction.ReactionState
    yielding: AdmittanceState
    clamp: ClampState
    place: RepeatedContactState


@value
class Felt:
    """What the answer is made from in one step."""

    model: RobotModel
    kin: Kinematics
    robot: RobotState
    found: Detection
    near: bool
    """Whether something is seen near the body, or cannot be seen for a unit is silent."""
    command: FloatArray
    """(n,) joint velocities commanded last [rad/s]."""
    profile: Profile
    planes: FloatArray
    """(P, 4) planes of fixtures, rows (normal, offset)."""
    standing: Capsules
    """Other fixtures, base frame."""


def seen_near(obstacles: Obstacles, params: ReactionParams) -> bool:
    """Whether something is seen near the body, for an answer that asks."""
    return params.method == "admittance" and float(obstacles.body_distance.min(initial=np.inf)) < params.near_m


@value
class Answer:
    """How the arm moves with a contact."""

    velocity: FloatArray
    """(3,) of the end-effector origin [m/s]."""
    qd: FloatArray | None
    """(n,) joint velocities [rad/s], None where only the end-effector's are asked for."""
    touch: float | None
    """Speed at which it may touch what it sees [m/s]: none where a push moves it, and as fast as it opens where it is
    caught, for it is between two things; None as without a contact."""


Doing = Literal["task", "learn", "react", "soft", "still"]
"""What the arm does: follow its task or stand with its window filling (`learn`), react, hold softly, hold still."""


def response_init(q: FloatArray, params: ReactionParams) -> ResponseState:
    """Return the state without a contact, at joint positions (n,) [rad]."""
    return ResponseState(
        reaction.reaction_init(params), admittance_init(len(q), params), clamp_init(q), repeated_contact_init()
    )  # fmt: skip


def adopted(state: ResponseState, mine: ReactionParams, theirs: ReactionParams) -> ResponseState:
    """Go on under other parameters; a reaction of eq. 12 that is over stays so."""
    going = reaction.active(state.decay, theirs)
    return replace(state, decay=state.decay if going else reaction.reaction_init(mine))


def noticed(state: ResponseState, doing: Doing, felt: Felt, phase: float, resume: bool) -> ResponseState:
    """Take in what is felt in one step, before it is known what the arm will do.

    Args:
        state: memory.
        doing: what the arm has done up to this step.
        felt: what is felt.
        phase: how far the task is along the path [m].
        resume: whether a person asks to go on.
    """
    p, dt = felt.profile.reaction, felt.profile.task.control_period_s
    if p.method == "decay":
        return state
    yielding, clamp, place, residual = state.yielding, state.clamp, state.place, _residual(state.yielding, felt)
    if doing == "learn" or (doing == "task" and felt.found.contact is None):
        yielding = learnt(yielding, residual, dt, p)
    elif doing in ("react", "soft"):
        band = dead_band(felt.model.description.tau_max, p)
        contact = felt.found.evidence >= 1.0
        yielding = yielded(yielding, (felt.model, felt.kin), residual, felt.command, band, dt, p, contact)
    if doing == "soft" and clamp.torque:
        # out of the clamp it may be moved, not back into it
        yielding = replace(yielding, velocity=np.where(yielding.velocity * clamp.course > 0, 0.0, yielding.velocity))
    if doing == "react" and p.clamps and not clamp.torque:
        clamp = _pinch(
            clamped(clamp, yielding.torque, yielding.velocity, felt.robot.q_commanded, _COURSE_RAD_S, dt, p), felt
        )  # fmt: skip
    elif doing == "task" and p.pinches:
        clamp = gone(clamp, felt.robot.q_commanded, dt)
    if doing == "react":
        place = discount_push(place, yielding.tank - p.start_energy_j)
    if resume:
        place, clamp = repeated_contact_init(), clamp_init(felt.robot.q_commanded)
    elif given_up(place, p) and doing != "react":
        place = wait_to_retry(place, felt.near, dt, p)
    elif doing == "task":
        place = forget_passed(place, phase, p)
    return ResponseState(state.decay, yielding, clamp, place)


def _pinch(clamp: ClampState, felt: Felt) -> ClampState:
    """Look for something caught between two links, or one and a fixture, as long as a contact is felt."""
    p, found = felt.profile.reaction, felt.found
    if not p.pinches or clamp.torque or found.clear is None:
        return clamp
    torque, covariance = found.clear
    pinch = find_self_clamp(felt.model, felt.kin, torque, covariance, clamp.came, p)
    names = felt.model.links
    if pinch is not None:
        one, other = (names[link] for link in pinch.link)
        return caught_between(clamp, f"{one} and {other}", pinch.force, torque)
    if presses_on_fixture(felt.model, felt.kin, found.touched, felt.planes, felt.standing, clamp.came, p):
        force = float(np.linalg.norm(found.touched.force[0]))
        return caught_between(clamp, f"{names[found.touched.link[0]]} and a fixture", force, torque)
    return clamp


def _residual(state: AdmittanceState, felt: Felt) -> FloatArray:
    """Return the external torques (n,) [Nm]; without an estimate, those of free motion, which drive nothing."""
    found = felt.found.residual
    return state.mean[1] if np.isnan(found).any() else found


_COURSE_RAD_S = 0.05
"""Speed in joint space from which the arm is on a course [rad/s]."""


def began(state: ResponseState, doing: Doing, felt: Felt, phase: float, point: FloatArray) -> ResponseState:
    """Begin to move with the contact that was found; one the arm brought about in its task counts for its place.

    Args:
        state: memory.
        doing: what the arm has done up to this step.
        felt: what is felt.
        phase: how far the task is along the path [m].
        point: (3,) where the end-effector is [m].
    """
    p, contact = felt.profile.reaction, felt.found.contact
    if contact is None:
        return state
    if p.method == "decay":
        return replace(state, decay=reaction.start_reaction(contact.force, p))
    torque, band = (
        _residual(state.yielding, felt) - state.yielding.mean[1],
        dead_band(felt.model.description.tau_max, p),
    )
    before = {"soft": state.yielding.steady[0], "still": torque}.get(doing, state.yielding.torque)
    yielding = begun(state.yielding, felt.model, felt.kin, torque, before, band, p)
    # what the arm ran into pushes against its motion; what pushes it on has come by itself
    mine = doing == "task" and float(torque @ felt.command) < 0
    place = replace(state.place, counted=False)
    if mine:
        kinetic = 0.5 * float(felt.command @ felt.model.mass_matrix(felt.robot.q) @ felt.command)
        place = count_contact(state.place, phase, point, felt.near, kinetic, p)
    came = felt.command if doing == "task" else np.zeros(len(torque))
    clamp = _pinch(clamp_begun(state.clamp, felt.robot.q_commanded, came), felt)
    return ResponseState(state.decay, yielding, clamp, place)


def answered(state: ResponseState, doing: Doing, felt: Felt) -> tuple[Answer | None, ResponseState]:
    """Return how the arm moves with a contact in this step, None where it does not, and what to remember."""
    p, dt = felt.profile.reaction, felt.profile.task.control_period_s
    if p.method == "decay":
        if doing != "react":
            return None, ResponseState(reaction.reaction_init(p), state.yielding, state.clamp, state.place)
        return Answer(reaction.decayed(state.decay, p), None, None), replace(state, decay=reaction.advance(state.decay))
    if doing not in ("react", "soft"):
        return None, state
    qd, model, kin = state.yielding.velocity, felt.model, felt.kin
    opens = doing == "react" and state.clamp.torque > 0 and not state.clamp.open
    if opens:
        way, clamp = opened(state.clamp, state.yielding.torque, felt.robot.q_commanded, dt, p)
        fastest = fastest_point(kin, model.moved_by, model.body.arrays, way)
        qd = way * min(1.0, p.open_m_s / fastest) if fastest > 0 else way
        state = replace(state, clamp=clamp, yielding=replace(state.yielding, velocity=np.zeros(len(qd))))
    if doing == "soft" and not qd.any():
        return None, state
    return Answer(model.ee_jacobian(kin)[:3] @ qd, qd, p.open_m_s if opens else 0.0), state


def waits(state: ResponseState, near: bool, lasting: bool, params: ReactionParams) -> bool:
    """Whether the arm still yields, or waits for more of the push, or for what presses or is near to go.

    For what is near it waits only where it will go on; it waits too while it is being found out if what is felt is a
    load (`Detection.lasting`).
    """
    quiet = state.yielding.quiet
    waits_for = (near and not given_up(state.place, params)) or _presses(state, params)
    return lasting or quiet < params.quiet_s or (waits_for and quiet < params.patience_s)


def presses_on(state: ResponseState, params: ReactionParams) -> bool:
    """Whether the arm has waited for long for something that is felt and does not move it."""
    return _presses(state, params) and state.yielding.quiet >= max(params.quiet_s, params.patience_s)


def _presses(state: ResponseState, params: ReactionParams) -> bool:
    """Whether an arm that static friction holds has felt something of late."""
    return params.static_friction_nm > 0 and state.yielding.unfelt < params.quiet_s


def moves(state: ResponseState, doing: Doing, params: ReactionParams) -> bool:
    """Whether a contact that is felt makes the arm move: an arm that holds softly sticks to static friction."""
    return doing != "soft" or params.static_friction_nm == 0 or bool(state.yielding.sliding.any())
