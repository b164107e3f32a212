"""The IMU LSM6DS3, or LSM6DS3TR-C (ST): gyroscope and accelerometer through its FIFO, some in each cycle.

Facts from ST: data sheet DocID026899, application note AN4650 (chapter on the FIFO); DS11857 for the TR-C. Errors are
OSError: 19 no such device, 5 it does not keep what was written, tells nonsense or lost its set-up, 110 it does not
answer in time.
"""

import time

from micropython import const

SET_SIZE = const(12)
"""Bytes of one sample of both: gyroscope x, y, z, accelerometer x, y, z, each 16 bits, little-endian, signed."""

_NO_DEVICE, _IO, _TIMEOUT = const(19), const(5), const(110)
_LSM6DS3, _LSM6DS3TR_C = const(0x69), const(0x6A)
_ADDRESSES = (0x6A, 0x6B)

_FIFO_CTRL3 = const(0x08)
_FIFO_CTRL5 = const(0x0A)
_WHO_AM_I = const(0x0F)
_CTRL1_XL = const(0x10)
_CTRL3_C = const(0x12)
_TEMPERATURE = const(0x20)
_FIFO_STATUS1 = const(0x3A)
_FIFO_DATA = const(0x3E)

_WHOLE_WORDS = b"\x44"  # CTRL3_C: block data update, address counts up
_SOFT_RESET = b"\x05"
_EMPTY = const(0x10)
_FULL = const(0x60)  # full, or run over
_WORDS = const(6)
_MARGIN = const(48)
"""A FIFO with so few words of room [words] may run over while it is read, and counts as having done so."""

_SETTLE_MS = const(80)
"""From power-down until the gyroscope is right [ms]."""
_SILENT_PERIODS = const(20)
"""An empty FIFO for so many periods: the device has lost its set-up."""

_RATE_HZ = const(416)
# registers at that rate: accelerometer of 4 g and gyroscope of 500 dps; FIFO without decimation; FIFO at the rate
_SCALES, _NOT_DECIMATED, _CONTINUOUS = b"\x68\x64", b"\x09\x00", b"\x36"
_SCALE_CODE = const(0x21)


class LSM6DS3:
    """One sensor on an I2C bus. `begin` fills its FIFO; then, each cycle: `count = sensor.drain(buffer, most)`."""

    rate_hz = _RATE_HZ
    """Nominal rate of both [Hz]; the true one may be some per cent off."""
    scale_code = _SCALE_CODE
    """Full scales as the wire has them: accelerometer in bits 0-1, gyroscope in bits 4-6."""

    def __init__(self, i2c, time=time):
        self._i2c = i2c
        self._address = _ADDRESSES[0]
        self._sleep_ms, self._ticks_us, self._ticks_diff = time.sleep_ms, time.ticks_us, time.ticks_diff
        self._status = bytearray(4)
        self._word = bytearray(2)
        self._identity = 0
        self._room = 0
        self._looked_us = 0
        self._gap = False
        self.waiting = 0
        """Samples that the last `drain` left in the FIFO."""
        self.lost = 0
        """Samples that were lost before those of the last `drain`, estimated by the time; 0: none."""

    def begin(self):
        """Reset and set up the sensor, which may have either address, and start its FIFO; takes some 80 ms."""
        self._find()
        self._reset()
        self._keep(_CTRL3_C, _WHOLE_WORDS)
        self._keep(_CTRL1_XL, _SCALES)
        self._sleep_ms(_SETTLE_MS)
        self._keep(_FIFO_CTRL3, _NOT_DECIMATED)
        self._keep(_FIFO_CTRL5, _CONTINUOUS)
        self.waiting = self.lost = 0
        self._gap = False
        self._looked_us = self._ticks_us()

    def drain(self, buffer, most):
        """Take the oldest samples, at most `most`, from the FIFO into a memoryview of so many; return how many."""
        words = self._look()
        if words > self._room:
            # a full FIFO shifts by parts of a sample with each that comes in, so room is made before aligning
            self._gap = True
            self._i2c.readfrom_mem_into(self._address, _FIFO_DATA, buffer[: most * SET_SIZE])
            words = self._look()
        now = self._ticks_us()
        if words == 0:
            return self._nothing(now)
        pattern = self._status[2]
        if pattern:
            self._gap = True
            words -= self._align(pattern, words)
        held = words // _WORDS
        count = min(held, most)
        gap, self._gap = self._gap, True  # so it is if the transfer fails half-way
        if count:
            self._i2c.readfrom_mem_into(self._address, _FIFO_DATA, buffer[: count * SET_SIZE])
        self._gap = False
        produced = self.waiting + self._ticks_diff(now, self._looked_us) * _RATE_HZ // 1_000_000
        self.lost = max(produced - held, 1) if gap else 0
        self.waiting = held - count
        self._looked_us = now
        return count

    def temperature_cdeg(self):
        """Temperature of the chip [0.01 degrees C]."""
        self._i2c.readfrom_mem_into(self._address, _TEMPERATURE, self._word)
        raw = self._word[0] | self._word[1] << 8
        raw -= (raw & 0x8000) << 1
        return 2500 + raw * 100 // (256 if self._identity == _LSM6DS3TR_C else 16)

    def _look(self):
        """Read the FIFO's status; return the words it holds. A full one shows 0, and is not empty."""
        status = self._status
        self._i2c.readfrom_mem_into(self._address, _FIFO_STATUS1, status)
        words = status[0] | (status[1] & 0x0F) << 8
        empty, full = status[1] & _EMPTY, status[1] & _FULL
        # a data line that is held or disturbed raises nothing, so what it tells is looked at
        if (words and empty) or not (words or empty or full) or status[2] >= _WORDS or status[3] & 3:
            raise OSError(_IO, "LSM6DS3 tells what no FIFO can hold")
        return words if words or empty else self._room + _MARGIN

    def _nothing(self, now):
        self.lost = 0
        if self._ticks_diff(now, self._looked_us) * _RATE_HZ > _SILENT_PERIODS * 1_000_000:
            raise OSError(_IO, "LSM6DS3 fills no FIFO: it lost its set-up")
        return 0

    def _align(self, pattern, words):
        """Drop the rest of a sample of which the beginning is lost; return how many words were dropped."""
        dropped = min((_WORDS - pattern) % _WORDS, words)
        for _ in range(dropped):
            self._i2c.readfrom_mem_into(self._address, _FIFO_DATA, self._word)
        return dropped

    def _find(self):
        for address in _ADDRESSES:
            try:
                identity = self._i2c.readfrom_mem(address, _WHO_AM_I, 1)[0]
            except OSError as error:
                if error.args[0] != _NO_DEVICE:
                    raise
                continue
            if identity in (_LSM6DS3, _LSM6DS3TR_C):
                self._address, self._identity = address, identity
                self._room = (2048 if identity == _LSM6DS3TR_C else 4096) - _MARGIN
                return
        raise OSError(_NO_DEVICE, "no LSM6DS3 on the bus")

    def _reset(self):
        self._i2c.writeto_mem(self._address, _CTRL3_C, _SOFT_RESET)
        for _ in range(10):
            self._sleep_ms(1)
            if not self._i2c.readfrom_mem(self._address, _CTRL3_C, 1)[0] & 1:
                return
        raise OSError(_TIMEOUT, "LSM6DS3 does not end its reset")

    def _keep(self, register, data):
        """Write registers and make sure that they hold what was written."""
        self._i2c.writeto_mem(self._address, register, data)
        if self._i2c.readfrom_mem(self._address, register, len(data)) != data:
            raise OSError(_IO, f"LSM6DS3 does not keep register 0x{register:02x}")
