"""The LSM6DS3 at the level of its registers, with time: a FIFO that fills, runs over and keeps its pattern."""

from fake_bus import Device, Refused

TURN_ON_US = 70_000
"""Of the gyroscope: what the FIFO takes in sooner is wrong."""
RESET_US = 50

_CODE, _RATE_HZ = 6, 416
_WRITABLE = {0x01, 0x0B, 0x0D, 0x0E} | set(range(0x04, 0x0B)) | set(range(0x10, 0x1B)) | set(range(0x58, 0x60))
_READABLE = {0x0F} | set(range(0x1B, 0x40)) | set(range(0x49, 0x4E))
_DEFAULTS = {0x12: 0x04, 0x18: 0x38, 0x19: 0x38}


class FakeLsm6ds3(Device):
    """The device. `sample(k)` tells the six words of sample number k since the FIFO was started, as signed integers."""

    address_bits = 8

    def __init__(self, clock, address=0x6A, identity=0x69, rate=1.0):
        """`rate`: by what factor the true rate is off the nominal one."""
        self.sample = lambda k: (k & 0x7FFF, 2, -3, 4, -5, 8192)
        self.temperature = 0
        """As in its registers: signed, 0 is 25 degrees C."""
        self.size = 2048 if identity == 0x6A else 4096
        """Words that the FIFO holds."""
        self._identity, self._rate = identity, rate
        super().__init__(clock, address)

    def slip(self, words):
        """Lose words from the FIFO, so that it begins inside a sample."""
        self._fill()
        self._taken += words

    # the bus

    def read(self, register, count):
        self._fill()
        self._check_burst(register, count)
        if register == 0x3E:
            return self._read_fifo(count)
        return bytes(self._value(register + i) for i in range(count))

    def write(self, register, data):
        self._fill()
        self._check_burst(register, len(data))
        for i in range(len(data)):
            self._write_one(register + i, data[i])

    # inside

    def _clear(self):
        self._registers = bytearray(0x80)
        for at, value in _DEFAULTS.items():
            self._registers[at] = value
        self._reset_until_us = self._clock.now_us + RESET_US
        self._on_us = None
        self._filling_us = None
        self._written = self._taken = 0
        self._overrun = False

    def _check_burst(self, register, count):
        for at in (register, register + count - 1):
            if at not in _WRITABLE and at not in _READABLE and not 0x3E <= register < 0x40:
                raise Refused(f"no register 0x{at:02x}")
        if count > 1 and not self._registers[0x12] & 4:
            raise Refused(f"{count} bytes at once while the address does not count up")

    def _write_one(self, at, value):
        if self._clock.now_us < self._reset_until_us:
            raise Refused(f"write to register 0x{at:02x} during the reset")
        if at not in _WRITABLE:
            raise Refused(f"write to register 0x{at:02x}")
        if at == 0x12 and value & 1:
            self._clear()
            return
        self._registers[at] = value
        if at in (0x10, 0x11):
            self._on_us = self._clock.now_us
        if at in (0x08, 0x09, 0x0A, 0x10, 0x11):
            self._set_fifo()

    def _set_fifo(self):
        r = self._registers
        self._filling_us = None
        self._written = self._taken = 0
        self._overrun = False
        mode, code = r[0x0A] & 7, r[0x0A] >> 3 & 15
        if mode == 0:
            return
        if (mode, code) != (6, _CODE):
            raise Refused(f"FIFO mode {mode} at rate {code}")
        if r[0x10] >> 4 != code or r[0x11] >> 4 != code:
            raise Refused("FIFO at another rate than the sensors")
        if r[0x08] != 0x09 or r[0x09] != 0:
            raise Refused("FIFO of other data than gyroscope and accelerometer, each sample")
        if not r[0x12] & 0x40:
            raise Refused("FIFO without block data update")
        self._filling_us = self._clock.now_us

    def _fill(self):
        if self._filling_us is None:
            return
        self._written = int((self._clock.now_us - self._filling_us) * _RATE_HZ * self._rate / 1e6) * 6
        if self._written - self._taken >= self.size:
            self._taken = self._written - self.size
            self._overrun = True

    def _value(self, at):
        held = self._written - self._taken
        pattern = self._taken % 6
        if at == 0x0F:
            return self._identity
        if at == 0x12 and self._clock.now_us < self._reset_until_us:
            return self._registers[at] | 1
        if at in (0x20, 0x21):
            return (self.temperature & 0xFFFF) >> 8 * (at & 1) & 0xFF
        if at == 0x3A:
            return held % self.size & 0xFF
        if at == 0x3B:
            full = held == self.size
            return held % self.size >> 8 | 0x10 * (held == 0) | 0x20 * full | 0x40 * self._overrun
        if at == 0x3C:
            return pattern
        return self._registers[at]

    def _read_fifo(self, count):
        if count % 2:
            raise Refused("half a word of the FIFO")
        if count // 2 > self._written - self._taken:
            raise Refused("more words than the FIFO holds")
        data = bytearray()
        for word in range(self._taken, self._taken + count // 2):
            value = self._word(word // 6, word % 6) & 0xFFFF
            data.append(value & 0xFF)
            data.append(value >> 8)
        self._taken += count // 2
        self._overrun = False
        return data

    def _word(self, number, at):
        if at < 3 and self._filling_us - self._on_us < TURN_ON_US:
            return 0x7FFF
        return self.sample(number)[at]
