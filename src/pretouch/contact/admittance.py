"""Reaction that yields to a push as long as it lasts: the admittance, with clamps, pinches and giving up."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pretouch.contact.clamp import (
    ClampState,
    begin_pinch,
    clamp_init,
    find_pinch,
    note_place,
    open_clamp,
    presses_on_fixture,
    update_clamp,
)
from pretouch.contact.detector import Body
from pretouch.contact.reaction import Reaction, ReactionInputs, ReactionMotion, contact_event, new_contact
from pretouch.contact.repeated_contact import (
    PathContact,
    RepeatedContactState,
    add_contact,
    discount_push,
    forget_passed,
    is_given_up,
    repeated_contact_init,
    wait_to_retry,
)
from pretouch.contact.virtual_mass import (
    Axes,
    VirtualMass,
    begin,
    dead_band,
    fastest_point,
    learn_mean,
    settle,
    within_reach,
    yield_to,
)
from pretouch.modes import Event, ModeState
from pretouch.params import AdmittanceParams, ClampParams
from pretouch.robot.body import placed
from pretouch.robot.kinematics import Kinematics, below
from pretouch.types import SEEN_NOW_S, FloatArray, Mode
from pretouch.values import value

Doing = Literal["task", "learn", "react", "soft", "still"]
"""Behaviour of the arm: follow the task, stand while the window fills (`learn`), react, hold softly, hold still."""


@value
class AdmittanceState:
    """Memory of the admittance beside its virtual mass."""

    clamp: ClampState
    place: RepeatedContactState
    origin: FloatArray | None = None
    """(2, C, 3) ends of the body's axes at the start of the reaction [m], None before the first."""
    moved: float = 0.0
    """Largest distance of these ends from there [m]."""


@dataclass(frozen=True)
class Admittance(AdmittanceParams, Reaction, name="admittance"):
    """A passive admittance in joint space (docs/explanation/reaction.md)."""

    State = AdmittanceState
    by_torques = True

    def init(self, body: Body, q: FloatArray) -> AdmittanceState:
        """Return the state without a contact, at joint positions (n,) [rad]."""
        return AdmittanceState(clamp_init(q), repeated_contact_init())

    def sense(
        self, state: AdmittanceState, body: Body, inputs: ReactionInputs
    ) -> tuple[dict[Event, str], AdmittanceState]:
        """Move the virtual mass, look for clamps, count contacts; return the events of the reaction."""
        doing, near = self._doing(inputs.mode, inputs.detection.armed), self._near(inputs)
        mass, clamp, moved, q, dt = inputs.mass, state.clamp, 0.0, inputs.robot.q_commanded, body.period
        self._move_mass(clamp, doing, body, inputs)
        if doing == "react" and state.origin is not None:
            # a soft hold has no such bound: a person who frees somebody, or guides the arm out, may move it farther
            mass.velocity[:], moved = within_reach(_axes(body, inputs.kin), mass.velocity, state.origin, self.reach_m)
        # a detected clamp stays: the arm opens out of it, without a search for others
        if doing == "react" and not clamp.torque:
            if self.clamp is not None:
                clamp = update_clamp(clamp, mass.torque, mass.velocity, q, dt, self.clamp)
            clamp = self._find_pinch(clamp, body, inputs)
        elif doing == "task" and self.pinch is not None:
            note_place(mass.path, mass.marked, q, dt)
        if inputs.resume:
            clamp, mass.path[:], mass.marked[0] = clamp_init(q), q, 0.0
        # the energy in the tank beyond its start is the least that the contact has given
        place = self._update_place(state.place, doing, mass.tank[0] - self.start_energy_j, near, dt, inputs)
        state = AdmittanceState(clamp, place, state.origin, moved)
        return self._events(state, doing, near, inputs), state

    def move(
        self, state: AdmittanceState, body: Body, inputs: ReactionInputs, mode: ModeState
    ) -> tuple[ReactionMotion | None, AdmittanceState]:
        """Return the joint velocities of the virtual mass, or of the opening of a clamp."""
        if new_contact(inputs, mode) is not None:
            state = self._begin(state, body, inputs)
        doing = self._doing(mode, inputs.detection.armed)
        if doing not in ("react", "soft"):
            return None, state
        qd, kin = inputs.mass.velocity.copy(), inputs.kin
        opens = doing == "react" and state.clamp.torque > 0 and not state.clamp.open
        if opens:
            # also for a pinch, where the search for other clamps is off
            p = self.clamp or ClampParams()
            back, clamp = open_clamp(state.clamp, inputs.mass.torque, inputs.robot.q_commanded, body.period, p)
            fastest = fastest_point(_axes(body, kin), back)
            qd = back * min(1.0, p.open_m_s / fastest) if fastest > 0 else back  # never beyond the place in one period
            state, inputs.mass.velocity[:] = replace(state, clamp=clamp), 0.0
        if doing == "soft" and not qd.any():
            return None, state
        # a pushed arm touches no obstacle; a clamped one is between two objects, and must get out
        touch_speed = (self.clamp or ClampParams()).open_m_s if opens else 0.0
        return ReactionMotion(body.model.ee_jacobian(kin)[:3] @ qd, qd, touch_speed), state

    def is_over(self, state: AdmittanceState) -> bool:
        """Return whether there is neither a clamp nor a location with contacts."""
        return not state.clamp.torque and not state.place.contacts

    def announced(self, period: float) -> str:
        """Say how fast the arm moves with a push, and when its task continues."""
        return (
            f"When pushed, it yields at up to {self.speed_max_m_s:g} m/s as long as the push lasts, by up to"
            f" {self.reach_m:g} m, and continues {self.quiet_s:g} s later: keep everything it could hit away from it."
        )

    def _doing(self, mode: ModeState, armed: bool) -> Doing:
        """Return the behaviour of the arm in a mode, as far as contacts matter."""
        if mode.mode is Mode.REACT:
            return "react"
        if mode.mode is Mode.TRACK:
            return "task"
        return "learn" if not armed else "soft" if mode.soft and self.soft_hold else "still"

    def _near(self, inputs: ReactionInputs) -> bool:
        """Return whether an obstacle is seen near the body, or may be missed."""
        near = inputs.obstacles
        return inputs.unseen or bool(((near.body_distance < self.near_m) & (near.age <= SEEN_NOW_S)).any())

    def _move_mass(self, clamp: ClampState, doing: Doing, body: Body, inputs: ReactionInputs) -> None:
        """Let the mass learn in free motion, and yield to the external torque in a reaction or a soft hold."""
        mass, detection, residual = inputs.mass, inputs.detection, _residual(inputs)
        if doing in ("learn", "task"):
            if doing == "learn" or detection.contact is None:
                learn_mean(mass, residual, body.period)
            settle(mass, self)
        elif doing in ("react", "soft"):
            band, axes = dead_band(body.model.description.tau_max, self), _axes(body, inputs.kin)
            # a hand may press less than it did, and a detector needs less evidence that it still does
            contact = detection.evidence >= 1.0 or (detection.suspected and mass.no_contact[0] < self.quiet_s)
            yield_to(mass, residual, inputs.command, band, axes, self.numbers, body.period, contact)
            if doing == "soft" and clamp.torque:
                # it may be moved out of the clamp, not back into it
                mass.velocity[mass.velocity * clamp.course > 0] = 0.0

    def _update_place(
        self, place: RepeatedContactState, doing: Doing, energy: float, near: bool, dt: float, inputs: ReactionInputs
    ) -> RepeatedContactState:
        """Judge the present contact by its energy [J], wait at a location given up, or forget one behind the arm."""
        if inputs.resume:
            return repeated_contact_init()
        if self.give_up is None:
            return place
        if doing == "react":
            return discount_push(place, energy)
        if is_given_up(place, self.give_up):
            return wait_to_retry(place, near, dt, self.give_up)
        return forget_passed(place, inputs.path_phase, inputs.robot.q) if doing == "task" else place

    def _begin(self, state: AdmittanceState, body: Body, inputs: ReactionInputs) -> AdmittanceState:
        """Begin to move with a detected contact; one that the arm caused in its task counts for its location."""
        model, kin, command = body.model, inputs.kin, inputs.command
        doing = self._doing(inputs.mode, inputs.detection.armed)
        torque = _residual(inputs) - inputs.mass.mean[1]
        band = dead_band(model.description.tau_max, self)
        # The torque before the onset: the last sample, or in a soft hold the filtered torque. A stiff hold has none:
        # there the sample itself counts.
        before = {"soft": inputs.mass.steady[0], "still": torque}.get(doing, inputs.mass.torque)
        begin(inputs.mass, _axes(body, kin), torque, before, band, self)
        place, contact = state.place, inputs.detection.contact if doing == "task" else None
        if contact is not None and self.give_up is not None:
            q, force = inputs.robot.q, float(np.linalg.norm(contact.force))
            kinetic = 0.5 * float(command @ model.mass_matrix(q) @ command)
            lever = torque / max(force, _LEAST_N)
            collision = PathContact(inputs.path_phase, kin.position[model.ee], q, lever, command, kinetic)
            place = add_contact(place, collision, self._near(inputs), self.give_up)
        else:
            place = replace(place, counted=False)
        # only the task closes a gap on something: without such a motion there is no pinch
        came = command if doing == "task" else np.zeros(len(torque))
        clamp = self._find_pinch(replace(clamp_init(inputs.robot.q_commanded), came=came), body, inputs)
        return AdmittanceState(clamp, place, np.array(placed(model.body, kin)[1:3]), 0.0)

    def _find_pinch(self, clamp: ClampState, body: Body, inputs: ReactionInputs) -> ClampState:
        """Look for a pinch between two links, or a link and a fixture, as long as a contact is detected."""
        p, significant, touched = self.pinch, inputs.detection.significant, inputs.detection.touched
        if p is None or clamp.torque or significant is None:
            return clamp
        (torque, covariance), names = significant, body.model.links
        pinch = find_pinch(body.model, inputs.kin, torque, covariance, clamp.came, p)
        if pinch is not None:
            one, other, force = pinch
            return begin_pinch(clamp, inputs.mass.path, f"{names[one]} and {names[other]}", force, torque)
        if presses_on_fixture(body, inputs.kin, touched, clamp.came, p):
            force = float(np.linalg.norm(touched.force[0]))
            return begin_pinch(clamp, inputs.mass.path, f"{names[touched.link[0]]} and a fixture", force, torque)
        return clamp

    def _events(self, state: AdmittanceState, doing: Doing, near: bool, inputs: ReactionInputs) -> dict[Event, str]:
        """Return the events: a contact that moves the arm, the state of the reaction, and a location given up."""
        mass, clamp, place = inputs.mass, state.clamp, state.place
        # an arm that holds softly sticks to static friction
        sticks = doing == "soft" and self.static_friction_nm > 0 and not mass.sliding.any()
        events = {} if sticks else contact_event(inputs.detection)
        # at most one of these, the first that applies; giving up is reported beside it
        if clamp.torque:
            apart = f"{clamp.between}, pushed apart with {clamp.force:.0f} N"
            against = f"{clamp.torque:.1f} Nm against the direction of yielding"
            events[Event.CLAMPED if clamp.open else Event.OPENING] = apart if clamp.between else against
        elif doing == "react" and self._waits(state.place, near, inputs):
            until = ", once nothing is seen near it" if near and not is_given_up(place, self.give_up) else ""
            at_reach = state.moved > _FAR * self.reach_m
            far = f"; it is {state.moved:.2f} m away, and moves no farther" if at_reach else ""
            events[Event.YIELDING] = f"{self.quiet_s:g} s after the last push{until}{far}"
        elif doing in ("react", "soft") and self._presses(mass) and mass.quiet[0] >= max(self.quiet_s, self.patience_s):
            torque = np.abs(mass.steady[1])
            events[Event.PRESSED] = f"{self.patience_s:g} s, about {torque.max():.0f} Nm at joint {torque.argmax() + 1}"
        if self.give_up is not None and place.met is not None and is_given_up(place, self.give_up):
            x, y, z = place.met.point
            when = f"{self.give_up.retry_s:g} s have passed"
            when = f"nothing is seen within {self.near_m:g} m of it" if place.seen else when
            events[Event.GIVEN_UP] = (
                f"{place.contacts} contacts at one place of the path, ({x:.2f}, {y:.2f}, {z:.2f}) m: clear it; the arm"
                f" tries again when {when}, or on resume"
            )
        return events

    def _waits(self, place: RepeatedContactState, near: bool, inputs: ReactionInputs) -> bool:
        """Return whether the arm still yields, or waits for more of the push, or for a force or an obstacle to go.

        It waits for an obstacle only where the task will continue; it also waits while the detector decides whether the
        residual is a load (`Detection.lasting`).
        """
        quiet = inputs.mass.quiet[0]
        waits_for = (near and not is_given_up(place, self.give_up)) or self._presses(inputs.mass)
        return inputs.detection.lasting or quiet < self.quiet_s or (waits_for and quiet < self.patience_s)

    def _presses(self, mass: VirtualMass) -> bool:
        """Return whether an arm that static friction holds has recently detected a contact."""
        return self.static_friction_nm > 0 and mass.no_contact[0] < self.quiet_s


def _axes(body: Body, kin: Kinematics) -> Axes:
    """Return the axes of the body in a posture."""
    return kin, body.model.moved_by, body.model.body


def _residual(inputs: ReactionInputs) -> FloatArray:
    """Return the external torques (n,) [Nm]; without an estimate those of free motion, which move nothing."""
    residual = inputs.detection.residual
    return residual if below(residual, np.inf) else inputs.mass.mean[1].copy()


_FAR = 0.95
"""Share of its reach from which the arm reports that it moves no farther."""
_LEAST_N = 5.0
"""Least force that divides torques [N]: the estimate of a smaller one is mostly noise."""
