"""Which link a unit sits on: the one whose turning its gyroscope measured."""

from dataclasses import dataclass, field

import numpy as np

from pretouch.calibration.alignment import Alignment, align
from pretouch.calibration.checks import mistaken
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import Located, enough, known_instants, locate
from pretouch.calibration.signals import ImuSignal
from pretouch.calibration.values import CalibrationParams, Finding, UnitData
from pretouch.errors import CalibrationError
from pretouch.types import FloatArray

_CLOSE = 0.02
"""Links whose likeness is less than the best by no more are distinguished by fits."""
_AMBIGUOUS = 1.5
"""Two fits whose differences, both sensors' multiplied, are within this factor tell no link apart."""
_STILL = 0.05
"""Share of the least turning of any link that a unit measures at most if it was left lying somewhere."""
_SCALE = 0.1
"""By how much a gyroscope's scale may be off at first sight."""


@dataclass(frozen=True)
class _Match:
    """How well a unit fits a rigid body, a set of links that all the same joints move."""

    body: tuple[int, ...]
    alignment: Alignment


@dataclass(eq=False)
class Identified:
    """What is known of the link a unit sits on."""

    body: tuple[int, ...] = ()
    """Indices of the links it may sit on, all fixed to each other; none if it fits no link."""
    located: Located | None = None
    findings: list[Finding] = field(default_factory=list)


class Identifier:
    """Finds links, on one arm in one motion."""

    def __init__(self, arm: ArmMotion, params: CalibrationParams) -> None:
        self.arm, self.params = arm, params
        self._step = float(arm.time[1] - arm.time[0])
        self._half_s = 0.5 * float(np.ptp(arm.time)) + params.clock_error_s
        rigid = arm.model.rigid
        bodies = [tuple(np.flatnonzero(rigid == body).tolist()) for body in range(int(rigid.max()) + 1)]
        turning = {body: float(_rms(arm.link(body[0]).w[arm.usable])) for body in bodies}
        least = params.least_swing_rad / np.ptp(arm.time)
        self._turning = {body: rms for body, rms in turning.items() if rms > least}
        if not self._turning:
            raise CalibrationError("No link turned back and forth: run a calibration motion.")

    def identify(self, unit: UnitData) -> Identified:
        """Find the link of a unit whose data passed all checks of its own."""
        signal = ImuSignal(unit, self.params)
        given = None if unit.link is None else self.arm.model.link_index(unit.link)
        stamps = self._own_stamps(unit)
        usable = signal.usable(stamps)
        if not enough(self.arm, usable, self.params):
            return Identified(findings=[_too_little(self.params)])
        meanwhile = usable & (np.abs(stamps - np.median(self.arm.time)) < self._half_s)
        values = signal.at(stamps).values[meanwhile if meanwhile.any() else usable, :3]
        if _rms(values) < _STILL * min(self._turning.values()):
            return Identified(findings=[_never_moved(values, min(self._turning.values()))])
        matches = self._matches(signal, self.arm.time, self.params.clock_error_s)
        best = max(match.alignment.likeness for match in matches)
        findings: list[Finding] = []
        if best < self.params.likeness:
            matches = self._matches(signal, stamps, np.inf)
            wide = max(matches, key=lambda match: match.alignment.likeness)
            if wide.alignment.likeness < self.params.likeness:
                return Identified(findings=[_fits_none(best, self.params)])
            best = wide.alignment.likeness
            findings.append(_clock(wide.alignment.late, self.params))
        close = [match for match in matches if match.alignment.likeness >= best - _CLOSE]
        return self._chosen(signal, close, given, findings)

    def _own_stamps(self, unit: UnitData) -> FloatArray:
        begin, end = unit.imu.stamp[0], unit.imu.stamp[-1]
        return begin + self._step * np.arange(int((end - begin) / self._step))

    def _matches(self, signal: ImuSignal, stamps: FloatArray, most: float) -> list[_Match]:
        sensed, sensing = signal.at(stamps).values[:, :3], signal.usable(stamps)
        matches = []
        for body in self._turning:
            found = align(self.arm.link(body[0]).w, self.arm.usable, sensed, sensing, self._step, most)
            late = found.late + float(stamps[0] - self.arm.time[0])
            matches.append(_Match(body, Alignment(late, found.likeness)))
        return matches

    def _chosen(self, signal: ImuSignal, close: list[_Match], given: int | None, findings: list[Finding]) -> Identified:
        """Choose among matches that are about as good."""
        close.sort(key=lambda match: -match.alignment.likeness)
        if not enough(self.arm, known_instants(self.arm, signal, close[0].alignment.late), self.params):
            return Identified(findings=[_too_little(self.params)])
        problem = self._gyroscope(signal, close[0])
        if problem is not None:
            return Identified(close[0].body, None, [*findings, problem])
        fits = [(match.body, self._fit(signal, match, given)) for match in close]
        fitted = [(body, located) for body, located in fits if located is not None]
        if not fitted:
            return Identified(close[0].body, None, [_too_little(self.params)])
        scores = {body: float(located.noise[0] * located.noise[3]) for body, located in fitted}
        alike = [(body, located) for body, located in fitted if scores[body] <= _AMBIGUOUS * min(scores.values())]
        body, located = min(alike, key=lambda one: (given not in one[0], scores[one[0]]))
        if len(alike) > 1:
            others = [links for links, _ in alike if links != body]
            findings = [*findings, self._ambiguous(located.link, others, given in body)]
        return Identified(body, located, findings)

    def _fit(self, signal: ImuSignal, match: _Match, given: int | None) -> Located | None:
        link = given if given is not None and given in match.body else match.body[0]
        return locate(self.arm, signal, link, match.alignment.late, self.params)

    def _gyroscope(self, signal: ImuSignal, match: _Match) -> Finding | None:
        """Find a gyroscope whose scale is wrong, or whose axes are mirrored."""
        known = known_instants(self.arm, signal, match.alignment.late)
        w = self.arm.link(match.body[0]).w[known]
        sensed = signal.at(self.arm.time[known] + match.alignment.late).values[:, :3]
        scale = _rms(sensed) / max(_rms(w), 1e-9)
        if abs(scale - 1) > _SCALE:
            sentence = f"Its gyroscope measures {scale:.3g} times what its link turned: {mistaken('gyroscope', scale)}."
            return Finding("gyroscope_scale", sentence, True)
        U, size, Vt = np.linalg.svd((w - w.mean(axis=0)).T @ (sensed - sensed.mean(axis=0)))
        if size[2] > 0.01 * size[0] and np.linalg.det(U @ Vt) < 0:
            sentence = "Its gyroscope's axes are mirrored: one has the wrong sign, or two are swapped; correct them."
            return Finding("mirrored", sentence, True)
        return None

    def _ambiguous(self, link: int, others: list[tuple[int, ...]], given: bool) -> Finding:
        model = self.arm.model
        names = " or ".join(model.links[i] for i in (link, *(links[0] for links in others)))
        differ = np.any([model.moved_by[links[0]] != model.moved_by[link] for links in others], axis=0)
        joints = ", ".join(np.array(model.joints)[differ])
        sentence = f"It sits on {names}, which moved alike: move {joints} more, or name the link."
        if given:
            sentence = (
                f"It may sit on {names}, which moved alike, so the given link was used: move {joints} more to be sure."
            )
        return Finding("ambiguous", sentence, not given)


def _rms(values: FloatArray) -> float:
    """Root mean square size of vectors (N, 3) less their mean."""
    return float(np.sqrt(((values - values.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _never_moved(values: FloatArray, least: float) -> Finding:
    """Say that a unit turned much less than any link; `least` is the turning of the one that turned least [rad/s]."""
    sentence = (
        f"It never moved: its gyroscope varied by {np.rad2deg(_rms(values)):.2g} degrees/s while each link turned by"
        f" {np.rad2deg(least):.2g} degrees/s or more. Mount it on a link that a joint moves, and check its units."
    )
    return Finding("never_moved", sentence, True)


def _fits_none(best: float, params: CalibrationParams) -> Finding:
    sentence = (
        f"It fits no link of this arm: at most {best:.0%} of its rotation matches a link (at least"
        f" {params.likeness:.0%} needed). Check that its data are of this run and arm, and that it does not swing or"
        " slip on its link."
    )
    return Finding("no_link", sentence, True)


def _clock(late: float, params: CalibrationParams) -> Finding:
    sentence = (
        f"Its clock is {'late' if late > 0 else 'early'} by {abs(late):.3f} s, more than {params.clock_error_s:g} s:"
        " check that its data are of this run, then correct the stamps or allow more in clock_error_s."
    )
    return Finding("clock", sentence, True)


def _too_little(params: CalibrationParams) -> Finding:
    sentence = (
        f"Less than {params.shortest_s:g} s remain with both its samples and joint states free of gaps and within"
        " range: record again."
    )
    return Finding("too_little", sentence, True)
