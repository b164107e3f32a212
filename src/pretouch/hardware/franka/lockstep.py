"""A controller stepped within the arm's own loop: the same states give the same commands, to the last bit.

For a simulated arm that waits for each command (`pretouch serve-fci --lockstep`). A real arm waits for nobody.
"""

from collections.abc import Callable
from typing import Self

import numpy as np

from pretouch.contact.residual_model import ResidualModel
from pretouch.controller import Controller, ControllerState
from pretouch.errors import ParameterError
from pretouch.hardware.franka.client import Client
from pretouch.hardware.franka.limiter import PERIOD_S, SetPointLimiter
from pretouch.hardware.franka.limits import LimiterParams, motion_limits
from pretouch.hardware.franka.state import JOINTS, FrankaState, robot_state
from pretouch.hardware.keys import Keys
from pretouch.hardware.receiver import SkinReceiver
from pretouch.loop import Cycle, Recorder, explained
from pretouch.ports import touch_of
from pretouch.realtime import warm_up
from pretouch.sensing.skin import Skin
from pretouch.signals import noted
from pretouch.types import ControlStep, FloatArray, Inputs, RangeReadings, TouchReadings

_REST = [0.0] * JOINTS


def run_in_lockstep(
    client: Client,
    controller: Controller,
    skin_at: Callable[[float], RangeReadings],
    recorder: Recorder,
    done: Callable[[ControlStep], bool],
    resume: Callable[[], bool] = lambda: False,
    *,
    params: LimiterParams | None = None,
    learnt: ResidualModel | None = None,
) -> None:
    """Turn the controller once a period of the robot's time, until `done` says so of a step.

    All stamps are of the robot's time, from the first state of the motion on: the simulated arm's time jumps before it.
    The controller is compiled before the motion begins, for the arm waits less than a second for its first command. The
    arm comes to rest within its limits before the motion ends, also on Ctrl-C, SIGTERM, SIGHUP and whatever goes wrong
    in a step, which is raised afterwards.

    Args:
        client: connected to the arm.
        controller: its period must be a whole number of milliseconds.
        skin_at: returns the readings there are at a robot time [s]; asked at every state, used at each step.
        recorder: keeps the steps.
        done: whether a step was the last.
        resume: whether a person now asks to leave a latched HOLD.
        params: of the way from one set-point to the next.
        learnt: free motion as an earlier session left it.
    """
    every = round(controller.limits.period / PERIOD_S)
    if every < 1 or abs(every * PERIOD_S - controller.limits.period) > 1e-9:
        raise ParameterError(
            f"The controller has a period of {controller.limits.period!r} s, which is not a whole number of"
            " milliseconds: params.at_rate makes a profile for another rate."
        )
    warm_up(controller, robot_state(client.read(), 0.0))
    limiter = SetPointLimiter(motion_limits(controller.model, client.kind), params or LimiterParams())
    turning = _ControllerLoop(controller, skin_at, recorder, done, resume, every, learnt)
    with noted() as came:

        def answer(state: FrankaState, _since: float) -> tuple[FloatArray, bool]:
            wanted = _REST if came else turning.wanted(state)
            velocity = limiter.step(state, wanted)
            return np.array(velocity), (bool(came) or turning.ended) and limiter.at_rest

        client.control(answer)
    if turning.error is not None:
        raise turning.error


class _ControllerLoop:
    """The controller, turned by the arm's states."""

    def __init__(
        self, controller: Controller, skin_at: Callable[[float], RangeReadings], recorder: Recorder,
        done: Callable[[ControlStep], bool], resume: Callable[[], bool], every: int, learnt: ResidualModel | None,
    ) -> None:  # fmt: skip
        self._controller, self._skin_at, self._recorder = controller, skin_at, recorder
        self._done, self._resume, self._every = done, resume, every
        self._learnt = learnt
        self._state: ControllerState | None = None
        self._began, self._turns = 0.0, 0
        self._wanted = _REST
        self.ended = False
        """Whether there is nothing left to do but to come to rest."""
        self.error: Exception | None = None
        """What ended it, if it was not `done`."""

    def wanted(self, state: FrankaState) -> list[float]:
        """Return the set-point after a state."""
        if self.ended:
            return _REST
        try:
            self._look(state)
        except Exception as error:
            self.error, self.ended = error, True
        return _REST if self.ended else self._wanted

    def _look(self, state: FrankaState) -> None:
        readings = self._skin_at(state.time)
        if self._state is None:
            self._began = state.time
        if round((state.time - self._began) / PERIOD_S) >= self._turns * self._every:
            self._turns += 1
            self._turn(state, readings)

    def _turn(self, state: FrankaState, readings: RangeReadings) -> None:
        stamp = state.time
        report = robot_state(state, stamp)
        before = self._controller.init(report, self._learnt) if self._state is None else self._state
        robot = explained(self._controller, before, report, stamp)
        inputs = Inputs(stamp, robot, readings, self._resume(), touch_of(self._skin_at))
        step, self._state = self._controller.step(before, inputs)
        self._recorder.record(Cycle(inputs, before, step, self._state))
        self._wanted = step.command.tolist()
        self.ended = self._done(step)


class LockstepSkin:
    """Gives the readings there are at a robot time, as `run_in_lockstep` asks for them; a context manager.

    For one motion: the time of the next one is not that of the last.
    """

    def __init__(self, skin: Skin, keys: Keys, host: str, port: int, seed: int = 0) -> None:
        """Listen for the skin's units; what the receiver draws comes from the seed, so that runs repeat."""
        self._now = 0.0
        draw = np.random.default_rng([seed, 8]).bytes
        self.receiver = SkinReceiver(skin.network, keys, host, port, clock=lambda: self._now, draw=draw)

    def __call__(self, time: float) -> RangeReadings:
        """Take in what has come by a robot time [s]; return the newest reading of each unit."""
        self._now = time
        self.receiver.receive()
        return self.receiver.readings()

    def touch(self) -> TouchReadings | None:
        """Return the newest touch reading of each unit, as of the last time asked for."""
        return self.receiver.touch()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.receiver.close()
