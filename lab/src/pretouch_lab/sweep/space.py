"""The range of one swept parameter, as it is written: `detect.f_base_n=5:15`, and what lies in it."""

import math
from dataclasses import dataclass

from pretouch.errors import ExperimentError
from pretouch_lab.sweep.setting import UNITS, Value

_HOW = "write NAME=LOW:HIGH, NAME=LOW:HIGH:log, NAME=LOW:HIGH:LEVELS for a grid, or NAME=VALUE,VALUE,..."
_LEVELS = 5
_WORDS = {"yes": True, "true": True, "no": False, "false": False}


@dataclass(frozen=True)
class Dimension:
    """One swept parameter: a range of numbers, or some values to choose from."""

    name: str
    low: float = 0.0
    high: float = 1.0
    log: bool = False
    """Whether it is spread evenly by its logarithm."""
    whole: bool = False
    """Whether it holds whole numbers."""
    levels: int = _LEVELS
    """Values of a range that a grid takes."""
    choices: tuple[Value, ...] = ()
    """Values to choose from, in place of a range."""

    def at(self, part: float) -> Value:
        """Return the value at a part of the range, from 0 to 1; each choice and each whole number has as much of it."""
        if self.choices:
            return self.choices[min(int(part * len(self.choices)), len(self.choices) - 1)]
        if not self.whole:
            return self._between(part, self.low, self.high)
        low, high = (self.low - 0.5, self.high + 0.5) if not self.log else (self.low, self.high)
        return int(min(max(round(self._between(part, low, high)), self.low), self.high))

    def _between(self, part: float, low: float, high: float) -> float:
        if part <= 0.0:
            return low  # exact, as the end is
        if part >= 1.0:
            return high
        return low * (high / low) ** part if self.log else low + part * (high - low)

    def grid(self) -> list[Value]:
        """Return the values that a grid takes, both ends among them."""
        if self.choices:
            return list(self.choices)
        parts = [i / (self.levels - 1) for i in range(self.levels)]
        values = [self._between(part, self.low, self.high) for part in parts]
        return list(dict.fromkeys(round(v) for v in values)) if self.whole else list(values)

    @property
    def ends(self) -> list[Value]:
        """Values to try first, whether they are allowed: the ends of a range, or all choices."""
        return list(self.choices) or [self.at(0.0), self.at(1.0)]

    @property
    def written(self) -> str:
        """The range, for tables."""
        if self.choices:
            return ", ".join(map(str, self.choices))
        return f"{self.low:g} to {self.high:g}{', log' if self.log else ''}"


def dimension(name: str, text: str, now: Value) -> Dimension:
    """Read what a parameter, which holds `now` otherwise, is to be varied over. Raises ExperimentError."""
    said = f"The range {name}={text}"
    if not text.strip():
        raise ExperimentError(f"{said} is empty: {_HOW}.")
    if ":" not in text:
        words = [word.strip() for word in text.split(",")]
        choices = tuple(read_value(name, word, now) for word in words)
        if len(set(choices)) < len(choices):
            raise ExperimentError(f"{said} names a value twice: name each once.")
        return Dimension(name, choices=choices)
    whole = isinstance(now, int) and not isinstance(now, bool)
    if isinstance(now, str | bool):
        raise ExperimentError(f"{said} is not one of numbers: {name} is {now!r}, so write NAME=VALUE,VALUE.")
    low_text, high_text, *more = text.split(":")
    low, high = (float(read_value(name, part, now)) for part in (low_text, high_text))
    log, levels = False, _LEVELS
    for word in more:
        if word == "log":
            log = True
        elif word == "int" and not whole:
            raise ExperimentError(f"{said} is of whole numbers, and {name} is none: leave :int out.")
        elif word.isdigit() and int(word) >= 2:
            levels = int(word)
        elif word != "int":
            raise ExperimentError(f"{said} ends in {word!r}: {_HOW}.")
    if not low < high:
        raise ExperimentError(f"{said} goes from {low:g} to {high:g}: give the lower one first.")
    if log and low <= 0.0:
        raise ExperimentError(f"{said} is logarithmic and begins at {low:g}: begin above 0, or leave :log out.")
    return Dimension(name, low, high, log, whole, levels)


def read_value(name: str, text: str, now: Value) -> Value:
    """Read a value of the kind a parameter holds."""
    text = text.strip()
    if isinstance(now, bool):
        if text not in _WORDS:
            raise ExperimentError(f"{name} is {text!r}: write yes or no.")
        return _WORDS[text]
    if isinstance(now, str):
        return text
    try:
        value = int(text) if isinstance(now, int) else float(text)
        finite = math.isfinite(value)
    except (ValueError, OverflowError):
        kind = "a whole number" if isinstance(now, int) else "a number"
        raise ExperimentError(f"{name} is {text!r}: write {kind}.") from None
    if not finite:
        raise ExperimentError(f"{name} is {text}: write a finite number.")
    if name == UNITS and value < 1:
        raise ExperimentError(f"{name} is {text}: give 1 or more; without it the paper's seven are taken.")
    return value
