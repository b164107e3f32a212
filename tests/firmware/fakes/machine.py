"""The chip as MicroPython's `machine` shows it. `state` is what tests set and look at."""

PWRON_RESET, HARD_RESET, WDT_RESET, DEEPSLEEP_RESET, SOFT_RESET = 0, 6, 1, 5, 4


class Reset(BaseException):
    """The chip begins anew; nothing in Python can stop that."""


class State:
    def __init__(self):
        self.cause = PWRON_RESET
        self.memory = b""
        self.hz = 80_000_000
        self.clock = None
        self.bus = None
        self.pulses_until_free = 0
        self.pulses = 0
        self.watchdog_timeout = None
        self.fed_us = None

    def check_watchdog(self):
        """Bite if nobody fed the watchdog for 3 s."""
        if self.fed_us is not None and self.clock.now_us - self.fed_us > 3_000_000:
            raise Reset("watchdog")


state = State()


def reset():
    raise Reset("machine.reset")


def reset_cause():
    return state.cause


def freq(hz):
    state.hz = hz


class RTC:
    def memory(self, text=None):
        if text is None:
            return state.memory
        state.memory = bytes(text)
        return None


class Pin:
    IN, OUT, OPEN_DRAIN = range(3)

    def __init__(self, number, mode=None, value=None):
        self.number, self.mode = number, mode
        self._level = value

    def value(self, level=None):
        if level is None:
            return int(state.pulses >= state.pulses_until_free)
        state.pulses += int(level == 1 and self._level == 0)
        self._level = level
        return None


def SoftI2C(scl, sda, freq):
    state.pins = (scl.number, sda.number)
    return state.bus


def I2C(_, scl, sda, freq):
    return SoftI2C(scl, sda, freq)


class ADC:
    ATTN_11DB = 3

    def __init__(self, pin, atten=None):
        self.pin, self.atten = pin, atten

    def read_u16(self):
        return 0x8000

    def read_uv(self):
        return 1_250_400


class WDT:
    def __init__(self, timeout=None):
        state.watchdog_timeout = timeout
        self.feed()

    def feed(self):
        state.fed_us = state.clock.now_us
