"""One joint velocity motion: what to answer to each state of the arm."""

import time
from collections.abc import Callable

import numpy as np

from pretouch.hardware.franka.limiter import SetPointLimiter, refusal
from pretouch.hardware.franka.limits import MotionLimits
from pretouch.hardware.franka.orders import Boxes, Order, Told, Wish
from pretouch.hardware.franka.params import FrankaParams
from pretouch.hardware.franka.report import Communication
from pretouch.hardware.franka.state import JOINTS, FrankaState
from pretouch.types import FloatArray

_REST = [0.0] * JOINTS
_ARRIVED_RAD_S = 1e-4
"""Velocity that the arm may still report when its motion is ended."""


class Motion:
    """Follows the set-points of one request, comes to rest without them, and ends at rest."""

    def __init__(
        self, request: int, limits: MotionLimits, params: FrankaParams, boxes: Boxes, communication: Communication,
        is_over: Callable[[], bool],
    ) -> None:  # fmt: skip
        """Take the request's number, where orders come from and states go to, and what ends the motion anyway."""
        self._request, self._limits, self._params, self._boxes = request, limits, params, boxes
        self._communication, self._is_over = communication, is_over
        self._limiter = SetPointLimiter(limits, params.limiter)
        self._order: Order | None = None
        self._ending = self._stale = False
        self.trouble = ""
        """Why the motion was ended, if nobody asked for that."""
        communication.begin()

    def answer(self, state: FrankaState, since: float) -> tuple[FloatArray, bool]:
        """Return joint velocities (7,) [rad/s] and whether the motion is finished, `since` [s] after the last state."""
        now = time.monotonic()
        order = self._boxes.ordered()
        velocity = self._limiter.step(state, self._wanted(order, now))
        finished = self._ending and self._limiter.at_rest and max(map(abs, state.dq_d.tolist())) < _ARRIVED_RAD_S
        self._boxes.tell(Told(now, self._request, True, self.trouble, state))
        self._communication.reseeds += self._limiter.lost
        self._communication.answered(since, state.success_rate, time.monotonic() - now)
        return np.array(velocity), finished

    def _wanted(self, order: Order, now: float) -> list[float]:
        """Return the velocities to go to: the set-point, or rest."""
        wished = order.wish is Wish.MOVE and order.request == self._request
        self._ending = self._ending or not wished or self._is_over()
        if not self._ending:
            self.trouble = self._against(order, now)
            self._ending = bool(self.trouble)
        if self._ending:
            return _REST
        was, self._stale = self._stale, now - order.stamp > self._params.stale_after_s
        if self._stale and not was and not self._limiter.at_rest:
            self._communication.stale += 1
        return _REST if self._stale else order.qd

    def _against(self, order: Order, now: float) -> str:
        """Say what an order has that ends the motion, or ''."""
        wrong = ""
        if order is not self._order:
            self._order, wrong = order, refusal(order.qd, self._limits)
        most = self._params.end_after_s
        if now - order.stamp > most:
            return (
                f"The arm was brought to rest and its motion ended: no set-point came for {most:g} s; look at what"
                " commands it, then begin anew."
            )
        return f"The arm was brought to rest: {wrong}; look at what commands it." if wrong else ""
