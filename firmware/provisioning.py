"""Tells a unit over USB who it is and where it sends: one JSON line in, one out (docs/how-to/flashing.md).

Key and password are only ever taken, never given.
"""

import json

from config import Config, ConfigError
from micropython import const

_PROTOCOL = const(1)
_LONGEST = const(512)
_WAIT_MS = const(20)


class Provisioning:
    """Answers lines. `config` is what is stored, or None; `facts` goes into each answer about this unit."""

    def __init__(self, config, facts):
        self.config = config
        self._facts = facts

    def answer(self, line):
        """Return the answer to a line as a dictionary, and store what it brings."""
        try:
            asked = json.loads(line)
        except ValueError:
            return _refusal("the line is not JSON")
        if not isinstance(asked, dict) or "pretouch" not in asked:
            return _refusal("the line must be a JSON object with the member pretouch")
        if asked["pretouch"] == "hello":
            return self._about()
        if asked["pretouch"] != _PROTOCOL or isinstance(asked["pretouch"], bool):
            return _refusal(f'pretouch must be {_PROTOCOL} or "hello"')
        try:
            config = Config(asked)
            config.save()
        except ConfigError as error:
            return _refusal(str(error))
        except OSError as error:
            return _refusal(f"the configuration could not be stored: error {error.args[0]}")
        self.config = config
        return self._about()

    def _about(self):
        answer = {"ok": True, "unit": None, "fingerprint": None}
        if self.config:
            answer["unit"], answer["fingerprint"] = self.config.unit, self.config.fingerprint
        answer.update(self._facts)
        return answer

    def listen(self, console, clock, window_us):
        """Answer what comes until no sound line did for a while [us]; without a configuration, for ever.

        `console.read(ms)` returns the bytes that are there, b"" if none come for so many ms; `console.write(text)`.
        """
        last = clock.ticks()
        line = bytearray()
        while self.config is None or clock.diff(clock.ticks(), last) < window_us:
            for byte in console.read(_WAIT_MS):
                if byte not in b"\r\n":
                    if len(line) <= _LONGEST:
                        line.append(byte)
                    continue
                if line:
                    answer = self._answer_within(line)
                    console.write(json.dumps(answer) + "\n")
                    if answer["ok"]:
                        last = clock.ticks()
                line = bytearray()

    def _answer_within(self, line):
        return _refusal(f"the line is longer than {_LONGEST} bytes") if len(line) > _LONGEST else self.answer(line)


def _refusal(why):
    return {"ok": False, "error": why}
