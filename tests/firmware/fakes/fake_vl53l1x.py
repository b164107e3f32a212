"""The VL53L1X at the level of its registers, with time: what it is set to decides when it has measured.

A measurement takes as long as the timeouts and VCSEL periods in the registers say, by the frequency of its fast clock,
plus a fixed part. In timed ranging they start on a grid of the period, which the slow oscillator counts. What a start
does that comes before the last measurement is through is not sure: here it is missed, so the period doubles, which is
the worst that it can be; others of ST's papers let the next measurement begin at once.
"""

from binascii import crc32

from fake_bus import Device, Refused

BOOT_US = 1_200
"""From the end of a reset until it answers (DS12385, 2.7)."""
FIXED_US = 11_900
"""Of a measurement, besides the two timeouts: ST's 20 ms in short mode less its two timeouts."""
FULL_VHV_US = 40_000
"""Longer takes the first measurement, or one after a full VHV was asked for."""
GUARD_US = 4_000
"""From the end of a measurement until it can start the next: a guess on the safe side."""
FAST_CLOCK = 0xBCCC
"""Frequency of the fast clock [MHz / 4096]."""
OSCILLATOR = 37
"""Counts of the slow oscillator in a millisecond, as its calibration register says."""
TRUE_OSCILLATOR = 39.6
"""What they are indeed: ST's factors, 1.065 when reading a period and 1.075 when setting it, lie on both sides."""

_SETTABLE = {0x2D, 0x2E, 0x2F, 0x30, 0x31, 0x46, 0x4B, 0x6C, 0x6D, 0x6E, 0x6F, 0x7F, 0x80, 0x86, 0x87}
_SETTABLE |= set(range(0x5E, 0x6A)) | set(range(0x72, 0x76)) | set(range(0x78, 0x7C))
_OTHERS_CRC = 0xA673CB5E
"""CRC of ST's defaults of 0x2D to 0x87 with the settable ones zero."""

_SHORT_MODE = {0x4B: 0x14, 0x60: 7, 0x63: 5, 0x69: 0x38, 0x78: 7, 0x79: 5, 0x7A: 6, 0x7B: 6}
_LONG_MODE = {0x4B: 0x0A, 0x60: 15, 0x63: 13, 0x69: 0xB8, 0x78: 15, 0x79: 13, 0x7A: 14, 0x7B: 14}
"""That of ST's defaults, in which it is calibrated."""


class FakeVl53l1x(Device):
    """The device. `target(us)` tells what a measurement with its middle at this time sees:
    (device status, mm, sigma, signal, ambient, spads), the last four as in the registers."""

    address_bits = 16

    def __init__(self, clock, model=0xEACC, slow=1.0, fast=1.0):
        """`slow` and `fast`: by what factor the slow oscillator and the fast clock are off."""
        self.target = lambda us: (9, 500, 10, 3000, 100, 40 << 8)
        self.measured = 0
        """Measurements since it was made."""
        self.middle_us = -1
        """Middle of the newest measurement."""
        self.starts = 0
        """How often ranging was started."""
        self._model, self._slow, self._fast = model, slow, fast
        super().__init__(clock, 0x29)

    def duration_us(self):
        """How long a measurement takes as it is set."""
        r = self._registers
        clock_us = 4096 / (FAST_CLOCK * self._fast) / 64
        step_us = 2304 * 2 * clock_us  # of a macro period, for one step of the VCSEL period
        a = self._timeout(0x5E) * (r[0x60] + 1) * step_us
        b = self._timeout(0x61) * (r[0x63] + 1) * step_us
        return int(FIXED_US + a + b)

    # the bus

    def answers(self):
        return super().answers() and self._clock.now_us >= self._booted_us

    def read(self, register, count):
        self._advance()
        if self._held:
            raise Refused("read in reset")
        data = bytearray(count)
        for i in range(count):
            at = register + i
            if not self._known(at):
                raise Refused(f"no register 0x{at:04x}")
            data[i] = self._registers[at]
        return data

    def write(self, register, data):
        self._advance()
        if register == 0 and len(data) == 1:
            self._soft_reset(data[0])
            return
        if self._held:
            raise Refused("write in reset")
        for i in range(len(data)):
            self._write_one(register + i, data[i])

    # inside

    def _clear(self):
        self._registers = bytearray(0x111)
        self._held = False
        self._booted_us = self._clock.now_us + BOOT_US
        self._start_us = self._end_us = None
        self._origin_us = 0
        self._interrupt = False
        self._calibrated = False
        self._stream = -1
        r = self._registers
        r[0x06], r[0x07] = FAST_CLOCK >> 8, FAST_CLOCK & 0xFF
        r[0x30] = 0x11
        r[0xDF] = OSCILLATOR
        r[0xDE] = 0x04  # bits above the ten of the calibration are not zero
        r[0xE5] = 3
        r[0x10F], r[0x110] = self._model >> 8, self._model & 0xFF
        self._show_interrupt()

    def _soft_reset(self, value):
        if value not in (0, 1):
            raise Refused(f"soft reset 0x{value:02x}")
        self._clear()
        if value == 0:
            self._held, self._booted_us = True, self._clock.now_us

    def _known(self, at):
        return 0x2D <= at <= 0x99 or at in (1, 6, 7, 8, 0x0B, 0xDE, 0xDF, 0xE5, 0x10F, 0x110) or 0x16 <= at <= 0x23

    def _write_one(self, at, value):
        if not (0x2D <= at <= 0x87 or at in (8, 0x0B) or 0x16 <= at <= 0x23):
            raise Refused(f"write to register 0x{at:04x}")
        if at == 0x86:
            self._clear_interrupt(value)
        elif at == 0x87:
            self._start(value)
        elif self._end_us is not None:
            raise Refused(f"write to register 0x{at:04x} while ranging")
        elif at != 0x31:
            self._registers[at] = value
        self._show_interrupt()

    def _clear_interrupt(self, value):
        if value not in (0, 1):
            raise Refused(f"interrupt clear 0x{value:02x}")
        if value:
            self._interrupt = False

    def _start(self, mode):
        if mode == 0:
            self._start_us = self._end_us = None
            return
        if mode != 0x40:
            raise Refused(f"mode start 0x{mode:02x}")
        if self._end_us is not None:
            raise Refused("started while ranging")
        self._check()
        self.starts += 1
        self._stream = -1
        self._origin_us = self._start_us = self._clock.now_us
        self._end_us = self._start_us + self.duration_us() + (0 if self._vhv_known() else FULL_VHV_US)

    def _vhv_known(self):
        return self._calibrated and self._registers[8] == 0x09 and self._registers[0x0B] == 0

    def _check(self):
        r = self._registers
        others = bytes(0 if at in _SETTABLE else r[at] for at in range(0x2D, 0x88))
        if crc32(others) & 0xFFFFFFFF != _OTHERS_CRC:
            raise Refused("ranging without ST's default configuration")
        if r[0x46] != 0x20 or r[0x30] & 0x0F != 1:
            raise Refused("ranging without an interrupt at each measurement")
        if not any(all(r[at] == values[at] for at in values) for values in (_SHORT_MODE, _LONG_MODE)):
            raise Refused("ranging in half a distance mode")
        if self._period_us() <= 0:
            raise Refused("ranging without a period")

    def _period_us(self):
        return int(int.from_bytes(bytes(self._registers[0x6C:0x70]), "big") / (TRUE_OSCILLATOR * self._slow) * 1000)

    def _timeout(self, at):
        return (self._registers[at + 1] << self._registers[at]) + 1

    def _advance(self):
        """Let happen what has happened by now."""
        while self._end_us is not None and self._end_us <= self._clock.now_us:
            self._measure()
            period = self._period_us()
            ready = self._end_us + GUARD_US - self._origin_us
            self._start_us = self._origin_us + -(-ready // period) * period
            self._end_us = self._start_us + self.duration_us()
        self._show_interrupt()

    def _measure(self):
        self.measured += 1
        self._calibrated = True
        self._stream = self._stream + 1 if self._stream < 255 else 128
        self.middle_us = (self._start_us + self._end_us) // 2
        status, mm, sigma, signal, ambient, spads = self.target(self.middle_us)
        r = self._registers
        r[0x89], r[0x8A], r[0x8B] = 0x80 | status, 0, self._stream  # bits above the five of the status are not zero
        for at, value in (
            (0x8C, spads),
            (0x8E, signal + 5),
            (0x90, ambient),
            (0x92, sigma),
            (0x96, mm),
            (0x98, signal),
        ):
            r[at], r[at + 1] = value >> 8, value & 0xFF
        self._interrupt = True

    def _show_interrupt(self):
        active_low = self._registers[0x30] >> 4 & 1
        self._registers[0x31] = 2 | (int(self._interrupt) ^ active_low)
