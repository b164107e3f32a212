"""Link that a unit sits on: the one whose rotation its gyroscope measured."""

from dataclasses import dataclass, field

import numpy as np
import scipy  # see `signals`

from pretouch.calibration.checks import mistaken
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import Located, enough, known_instants, locate
from pretouch.calibration.signals import ImuSignal
from pretouch.calibration.values import CLOCK_ERROR_S, LEAST_SWING_RAD, SHORTEST_S, Remark, UnitData
from pretouch.errors import CalibrationError
from pretouch.types import BoolArray, FloatArray

_LIKENESS = 0.9
"""How much of a gyroscope's and a link's turning must be the same for the unit to sit on that link."""
_CLOSE = 0.02
"""Links whose likeness is less than the best by no more are distinguished by fits."""
_AMBIGUOUS = 1.5
"""Two fits whose differences, both sensors' multiplied, are within this factor tell no link apart."""
_SCALE = 0.1
"""By how much a gyroscope's scale may be off at first sight."""


_TOO_LITTLE = Remark(
    "too_little",
    f"Less than {SHORTEST_S:g} s remain with both its samples and joint states free of gaps and within range: record"
    " again.",
    True,
)


@dataclass(frozen=True)
class Alignment:
    """The best lag for one link."""

    late: float
    """Lag of the unit's clock [s]."""
    likeness: float
    """Similarity of both angular velocities, 0 to 1."""


_Match = tuple[tuple[int, ...], Alignment]
"""A rigid body, links that all the same joints move, and how well a unit fits it."""


@dataclass(eq=False)
class Identified:
    """Estimate of the link that a unit sits on."""

    body: tuple[int, ...] = ()
    """Indices of the links it may sit on, all fixed to each other; none if it fits no link."""
    located: Located | None = None
    findings: list[Remark] = field(default_factory=list)


class Identifier:
    """Finds links, on one arm in one motion."""

    def __init__(self, arm: ArmMotion) -> None:
        self.arm = arm
        self._step = float(arm.time[1] - arm.time[0])
        rigid = arm.model.rigid
        bodies = [tuple(np.flatnonzero(rigid == body).tolist()) for body in range(int(rigid.max()) + 1)]
        least = LEAST_SWING_RAD / np.ptp(arm.time)
        self._turning = [body for body in bodies if _rms(arm.link(body[0]).w[arm.usable]) > least]
        if not self._turning:
            raise CalibrationError("No link turned back and forth: run a calibration motion.")

    def identify(self, unit: UnitData) -> Identified:
        """Find the link of a unit whose data passed all checks of its own."""
        signal = ImuSignal(unit)
        named = None if unit.link is None else self.arm.model.link_index(unit.link)
        begin, end = unit.imu.stamp[[0, -1]]
        own = begin + self._step * np.arange(int((end - begin) / self._step))
        if not enough(self.arm, signal.usable(own)):
            return Identified(findings=[_TOO_LITTLE])
        findings: list[Remark] = []
        matches = self._matches(signal, self.arm.time, CLOCK_ERROR_S)
        if matches[0][1].likeness < _LIKENESS:
            near, matches = matches[0][1], self._matches(signal, own, np.inf)
            if matches[0][1].likeness < _LIKENESS:
                sentence = (
                    f"It fits no link of this arm: at most {near.likeness:.0%} of its rotation matches a link (at least"
                    f" {_LIKENESS:.0%} needed). Check that its data are of this run and arm, that a joint moves its"
                    " link, and that it does not swing or slip on it."
                )
                return Identified(findings=[Remark("no_link", sentence, True)])
            late = matches[0][1].late
            sentence = (
                f"Its clock is {'late' if late > 0 else 'early'} by {abs(late):.3f} s, more than {CLOCK_ERROR_S:g} s:"
                " check that its data are of this run, then correct the stamps."
            )
            findings.append(Remark("clock", sentence, True))
        close = [(body, match) for body, match in matches if match.likeness >= matches[0][1].likeness - _CLOSE]
        return self._chosen(signal, close, named, findings)

    def _matches(self, signal: ImuSignal, stamps: FloatArray, most: float) -> list[_Match]:
        """Return how well a unit fits each body, and how late its clock then is, the best first."""
        sensed, sensing = signal.at(stamps).values[:, :3], signal.usable(stamps)
        matches = []
        for body in self._turning:
            alignment = align(self.arm.link(body[0]).w, self.arm.usable, sensed, sensing, self._step, most)
            late = alignment.late + float(stamps[0] - self.arm.time[0])
            matches.append((body, Alignment(late, alignment.likeness)))
        return sorted(matches, key=lambda one: -one[1].likeness)

    def _chosen(self, signal: ImuSignal, close: list[_Match], named: int | None, findings: list[Remark]) -> Identified:
        """Choose among matches that are about as good."""
        first, match = close[0]
        instants = known_instants(self.arm, signal, match.late)
        if not enough(self.arm, instants):
            return Identified(findings=[_TOO_LITTLE])
        sensed = signal.at(self.arm.time[instants] + match.late).values[:, :3]
        if problem := _gyroscope(self.arm.link(first[0]).w[instants], sensed):
            return Identified(first, None, [*findings, problem])
        fitted = []
        for body, match in close:
            link = named if named is not None and named in body else body[0]
            if located := locate(self.arm, signal, link, match.late):
                fitted.append((body, located))
        if not fitted:
            return Identified(first, None, [_TOO_LITTLE])
        scores = {body: float(located.noise[0] * located.noise[3]) for body, located in fitted}
        alike = [(body, located) for body, located in fitted if scores[body] <= _AMBIGUOUS * min(scores.values())]
        body, located = min(alike, key=lambda one: (named not in one[0], scores[one[0]]))
        if len(alike) > 1:
            others = [links for links, _ in alike if links != body]
            findings = [*findings, self._ambiguous(located.link, others, named in body)]
        return Identified(body, located, findings)

    def _ambiguous(self, link: int, others: list[tuple[int, ...]], named: bool) -> Remark:
        model = self.arm.model
        names = " or ".join(model.links[i] for i in (link, *(links[0] for links in others)))
        differ = np.any([model.moved_by[links[0]] != model.moved_by[link] for links in others], axis=0)
        joints = ", ".join(np.array(model.joints)[differ])
        sentence = f"It sits on {names}, which moved alike: move {joints} more, or name the link."
        if named:
            sentence = (
                f"It may sit on {names}, which moved alike, so the given link was used: move {joints} more to be sure."
            )
        return Remark("ambiguous", sentence, not named)


def _rms(values: FloatArray) -> float:
    """Root mean square size of vectors (N, 3) less their mean."""
    return float(np.sqrt(((values - values.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _gyroscope(w: FloatArray, sensed: FloatArray) -> Remark | None:
    """Find a wrong scale or mirrored axes by a link's turning and what was sensed of it, (N, 3) each [rad/s]."""
    scale = _rms(sensed) / max(_rms(w), 1e-9)
    if abs(scale - 1) > _SCALE:
        sentence = f"Its gyroscope measures {scale:.3g} times what its link turned: {mistaken('gyroscope', scale)}."
        return Remark("gyroscope_scale", sentence, True)
    U, size, Vt = np.linalg.svd((w - w.mean(axis=0)).T @ (sensed - sensed.mean(axis=0)))
    if size[2] > 0.01 * size[0] and np.linalg.det(U @ Vt) < 0:
        sentence = "Its gyroscope's axes are mirrored: one has the wrong sign, or two are swapped; correct them."
        return Remark("mirrored", sentence, True)
    return None


def align(
    turning: FloatArray, turned: BoolArray, sensed: FloatArray, sensing: BoolArray, step: float, most: float
) -> Alignment:
    """Find the lag, at most `most` [s] either way, at which a gyroscope measured the rotation of a link.

    `turning` (N, 3) is the angular velocity of the link in its frame, `sensed` (M, 3) that of the sensor in its frame
    [rad/s], both every `step` [s] and from the same instant if the clocks agree; `turned` (N,) and `sensing` (M,) mask
    the known ones.

    Their cross-covariance is R^T times the covariance of one of them if they are the same but for a rotation R and a
    constant: its nuclear norm, divided by both norms, is then 1, whatever R and the gyroscope's bias are. Its greatest
    value over all lags tells the clocks' difference.
    """
    a, b = _centred(turning, turned), _centred(sensed, sensing)
    length = scipy.fft.next_fast_len(len(a) + len(b), real=True)
    fa, fb = scipy.fft.rfft(a, length, axis=0), scipy.fft.rfft(b, length, axis=0)
    cross = scipy.fft.irfft(fa.conj()[:, :, None] * fb[:, None, :], length, axis=0)
    # energies of both where they overlap: without them, short overlaps would never win
    energy = np.sqrt(_overlap((a**2).sum(axis=1), sensing, length) * _overlap(turned, (b**2).sum(axis=1), length))
    lags = np.arange(length)
    lags[lags > length - len(a)] -= length
    shared = _overlap(turned, sensing, length)
    # a tenth of the shorter one must overlap, or chance would make two short pieces alike
    fair = (np.abs(lags) * step <= most) & (shared > 0.1 * min(turned.sum(), sensing.sum())) & (energy > 1e-9)
    if not fair.any():
        return Alignment(0.0, 0.0)
    looked = fair | np.roll(fair, 1) | np.roll(fair, -1)  # the peak's neighbours are needed too
    norm = np.linalg.svd(cross[looked], compute_uv=False).sum(axis=1)
    likeness = np.zeros(length)
    likeness[looked] = norm / np.maximum(energy[looked], 1e-9)
    best = int(np.argmax(np.where(fair, likeness, 0.0)))
    return Alignment(float(lags[best] + _peak(likeness, best)) * step, float(min(likeness[best], 1.0)))


def _centred(signal: FloatArray, mask: BoolArray) -> FloatArray:
    mean = signal[mask].mean(axis=0) if mask.any() else 0.0
    return np.where(mask[:, None], signal - mean, 0.0)


def _overlap(first: FloatArray | BoolArray, second: FloatArray | BoolArray, length: int) -> FloatArray:
    """Sums of products at all lags (length,)."""
    a, b = (scipy.fft.rfft(np.asarray(values, np.float64), length) for values in (first, second))
    return np.maximum(scipy.fft.irfft(a.conj() * b, length), 0.0)


def _peak(values: FloatArray, i: int) -> float:
    """Return the offset of the peak of a parabola through three neighbours, in steps."""
    before, at, after = values[i - 1], values[i], values[(i + 1) % len(values)]
    bend = before - 2 * at + after
    return 0.0 if min(before, after) <= 0.0 or bend >= 0.0 else float(0.5 * (before - after) / bend)
