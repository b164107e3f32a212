"""One soak: a served arm that is run again and again, however the programs end, and a page beside it all the time."""

import os
import re
import signal
import time
from collections import Counter
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread

import msgspec
import numpy as np
from fci.tests.soak.programs import Program, WallClock, program
from fci.tests.soak.truth import Truth
from tests.page.visitor import CAMERA, PROTOCOL
from tests.ports import free_port, loopback
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from pretouch.arms.franka import identity
from pretouch.recording.reader import open_recording
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import skin_for
from pretouch.session.memory import ConfirmedRobots
from pretouch.units.keys import Keys, save_keys

MEMORY_GROWS, AT_FIRST, FIRST_S = 0.05, 0.15, 1200.0
"""Largest share by which the memory of a process may grow once it has all it needs; and in a run that stays for less
than so long [s], in which a page's visitors still fill what is kept for the next ones."""
RESTS_S = 0.5
"""Longest time until an arm rests after a kill [s]: set-points count for 0.05 s, braking takes up to 0.15 s, and what
is known of the truth is up to 0.1 s old."""
_WARM_S = 120.0
"""Time after which a process has all it needs [s]."""
_FULL_S, _FULL_SHARE = 60.0, 0.1
"""How long the disk is full [s], and at most for such a share of all."""
_ENDS = "SIGINT", "SIGTERM", "program", "arm's process", "receiver", "robot"
_STEP_S = 86400.0
"""Largest step of the wall clock [s]."""
_SMALL = 64 * 1024
_BUSY = ("communication_constraints_violation",)
"""Errors with which an arm ends a motion because this machine was too busy."""


_AT_ONCE = 3
LOSS = 0.1
"""Share of the units' datagrams lost, each way."""


class Visitors:
    """They come to a page, look, say something, read what they are sent or do not, and go without a word.

    Some at a time, in threads; a context manager.
    """

    def __init__(self, url: str, seed: int) -> None:
        self._address, self._over = url.replace("http", "ws", 1).rstrip("/"), Event()
        self._threads = [
            Thread(target=self._come_and_go, args=(np.random.default_rng([seed, i]),)) for i in range(_AT_ONCE)
        ]
        self.visits, self.errors = 0, list[str]()

    def __enter__(self) -> "Visitors":
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _come_and_go(self, rng: np.random.Generator) -> None:
        while not self._over.is_set():
            try:
                self._visit(rng)
            except (OSError, ConnectionClosed) as error:  # it is a failure: the page is there all the time
                self.errors.append(f"{type(error).__name__}: {error}")
                self._over.wait(1.0)
            self.visits += 1
            self._over.wait(rng.uniform(0.0, 5.0))

    def _visit(self, rng: np.random.Generator) -> None:
        reads = rng.random() < 0.7
        with connect(self._address, subprotocols=[PROTOCOL], max_size=None, max_queue=None if reads else 1) as page:
            page.send(msgspec.msgpack.encode(CAMERA))
            for _ in range(int(rng.integers(1, 40))):
                if self._over.wait(0.25):
                    break
                page.send(msgspec.msgpack.encode(CAMERA | {"fov": rng.uniform(0.3, 1.2)}))
                if reads:
                    with suppress(TimeoutError):
                        page.recv(timeout=0.0)


@dataclass
class Found:
    """What a soak counts."""

    ends: Counter[str] = field(default_factory=Counter)
    """How runs were ended."""
    rest_s: dict[str, list[float]] = field(default_factory=dict)
    """Times until the arm rested, by how the run was ended."""
    troubles: list[str] = field(default_factory=list)
    """Whatever must not be."""
    recordings: int = 0
    steps: int = 0
    clock_steps: int = 0
    visits: int = 0
    busy: int = 0
    """Motions that the arm ended because this machine was too busy."""
    reflexes: int = 0
    """Motions that the arm ended because something touched it."""
    others: int = 0
    """Motions that the arm ended for any other reason: each is a trouble."""
    speed: float = 0.0
    """Largest joint speed as a share of its limit."""
    memory: dict[str, tuple[float, float]] = field(default_factory=dict)
    """First and last memory of the processes that stay [MiB], by program and place."""
    seconds: float = 0.0


class Soak:
    """See the module; a context manager."""

    def __init__(self, folder: Path, seconds: float, seed: int) -> None:
        self._folder, self._rng, self._seconds = folder, np.random.default_rng(seed), seconds
        self._clock, self._stack, self.found = WallClock(folder / "clock"), ExitStack(), Found()
        self._address, self._units, self._runs = loopback(), free_port(), 0
        model = RobotModel(panda())
        self._qd_max = model.description.qd_max
        save_keys(Keys().with_new(skin_for(model).network.ids), folder / "keys.toml")
        ConfirmedRobots(folder / "state" / "pretouch").add(identity("panda", self._address))
        self._memory: dict[str, list[tuple[float, float]]] = {}

    def run(self) -> Found:
        """Play it: half of the time one run that stays, then runs that are killed; return what was found."""
        begun, found = time.monotonic(), self.found
        words = "live", "--port", str(free_port()), "--record", str(self._folder / "page.mcap")
        end = begun + self._seconds
        with self._stack as opened:
            page = opened.enter_context(program(self._folder, "page", *words, clock=self._clock))
            visitors = opened.enter_context(Visitors(page.said_within(r"(http://\S+)"), int(self._rng.integers(2**32))))
            with ExitStack() as serving:
                self._serve(serving)
                self._one_run(page, begun + 0.5 * self._seconds, "SIGINT")
                kinds: list[str] = []
                while time.monotonic() < end:
                    kinds = kinds or self._rng.permutation(_ENDS).tolist()  # each comes before one comes again
                    kind = kinds.pop()
                    self._one_run(page, time.monotonic() + self._rng.uniform(4.0, 20.0), kind)
                    if kind == "robot" or self._server.process.poll() is not None:
                        serving.close()
                        self._serve(serving)
            found.visits = visitors.visits
            found.troubles += [f"A visitor was let go: {error}" for error in visitors.errors]
            self._judge_text("page", page.said())
        self._judge_memory()
        found.seconds = time.monotonic() - begun
        return found

    def _serve(self, opened: ExitStack) -> None:
        place = self._folder / "truth.csv"
        units = "--units", f"127.0.0.1:{self._units}", "--keys", "keys.toml", "--loss", str(LOSS)
        words = "serve-fci", "--host", self._address, "--truth", str(place), "--start", "path", *units
        self._server = opened.enter_context(program(self._folder, "server", *words, clock=self._clock))
        self._server.said_within(r"(Listening) at")
        self._truth = Truth(place, self._qd_max)
        opened.callback(self._judge_server, self._server, self._truth)

    def _one_run(self, page: Program, until: float, kind: str) -> None:
        """Let a controller move the arm until an instant, end it in one way, and look at what is left."""
        self._runs += 1
        name = f"run-{self._runs}"
        record = self._folder / f"{name}.mcap"
        heard = "--keys", "keys.toml", "--units-port", str(self._units), "--floor", "-0.2", "--yes"
        words = "--ip", self._address, "--record", str(record), *heard
        with program(self._folder, name, "run", "franka", *words, clock=self._clock) as run:
            if run.said_within("(TRACK)"):
                full = self._seconds / 4.0 if self._runs == 1 else np.inf
                self._stay(run, page, until, full)
                self._end(run, kind)
            else:
                self.found.ends["ended by itself"] += 1
            self._judge_text(name, run.said())
        self._judge_recording(record)

    def _stay(self, run: Program, page: Program, until: float, full: float) -> None:
        """Wait, with steps of the clock and a full disk at a time [s], and look at memory."""
        begun, filled = time.monotonic(), False
        while (now := time.monotonic()) < until and run.process.poll() is None:
            self._truth.read()
            if self._rng.random() < 0.02:
                self._clock.step(self._rng.uniform(-_STEP_S, _STEP_S))
                self.found.clock_steps += 1
            if filled != (full <= now - begun < full + min(_FULL_S, _FULL_SHARE * self._seconds)):
                filled = not filled
                run.fill_disk(_SMALL if filled else -1)
            if self._runs == 1:
                self._look_at_memory({"run": run, "page": page, "server": self._server}, now - begun)
            time.sleep(0.5)

    def _end(self, run: Program, kind: str) -> None:
        """End a run, and measure how long the arm moves on."""
        self._truth.read()
        moved, instant = self._truth.moves, self._truth.now
        if run.process.poll() is not None:
            self.found.ends["ended by itself"] += 1
            return
        family = run.family()
        match kind:
            case "SIGINT" | "SIGTERM":
                run.end(getattr(signal, kind))
            case "program":
                run.end(signal.SIGKILL)
            case "robot":
                self._server.end(signal.SIGKILL)
            case _ if len(family) < 3:
                self.found.troubles.append(f"A run has {len(family)} processes.")
            case "arm's process" | "receiver":
                os.kill(family[1 if kind == "receiver" else 2], signal.SIGKILL)
        self.found.ends[kind] += 1
        if kind == "robot":
            run.process.wait(30.0)
            return
        time.sleep(1.5)
        self._truth.read()
        if moved:
            self.found.rest_s.setdefault(kind, []).append(self._truth.rested_after(instant))
        if run.process.poll() is None and kind == "receiver":
            run.end(signal.SIGINT)

    # what must be

    def _judge_text(self, name: str, said: str) -> None:
        if "Traceback" in said or "Please report" in said:
            self.found.troubles.append(f"{name} said:\n{said[-2000:]}")

    def _judge_server(self, server: Program, truth: Truth) -> None:
        truth.read()
        truth.close()
        found, said = self.found, server.said()
        self._judge_text("server", said)
        found.speed = max(found.speed, truth.largest)
        for names in re.findall(r"Motion ended: (.*)\.", said):
            errors = names.split(", ")
            if all(error in _BUSY for error in errors):
                found.busy += 1
            elif all(error.endswith("_reflex") for error in errors):
                found.reflexes += 1
            else:
                found.others += 1
                found.troubles.append(f"The arm ended a motion: {names}.")

    def _judge_recording(self, place: Path) -> None:
        try:
            self.found.steps += len(open_recording(place))
        except Exception as error:  # whatever it is, it is what is looked for
            self.found.troubles.append(f"{place.name} does not open: {error}")
        self.found.recordings += 1
        place.unlink(missing_ok=True)

    def _look_at_memory(self, programs: dict[str, Program], since: float) -> None:
        for name, one in programs.items():
            for i, megabytes in enumerate(one.memory()):
                self._memory.setdefault(f"{name} {i}", []).append((since, megabytes))

    def _judge_memory(self) -> None:
        """Hold the last tenth of the time against the tenth after the warm-up."""
        for name, looks in self._memory.items():
            late = [megabytes for since, megabytes in looks if since > min(_WARM_S, 0.5 * looks[-1][0])]
            tenth = max(1, len(late) // 10)
            first, last = float(np.median(late[:tenth])), float(np.median(late[-tenth:]))
            self.found.memory[name] = (first, last)
            if last > (1.0 + (MEMORY_GROWS if looks[-1][0] > FIRST_S else AT_FIRST)) * first:
                self.found.troubles.append(f"The memory of {name} grew from {first:.1f} to {last:.1f} MiB.")
