"""The range finder VL53L1X (ST): ranges by itself at a fixed period, read in one block. Units of results: the wire's.

Facts from ST: data sheet DS12385; user manuals UM2356 and UM2510; register names of the driver STSW-IMG009. Errors are
OSError: 19 no such device, 5 it does not keep what was written or lost its set-up, 110 it does not answer in time.
"""

import time

from micropython import const

_BUDGET_MS, _PERIOD_MS = const(15), const(20)
"""How long a measurement integrates, and from one start to the next: ST wants them 4 ms apart (UM2356, 2.2), so that no
start is missed."""
_ADDRESS = const(0x29)
_NO_DEVICE, _IO, _TIMEOUT = const(19), const(5), const(110)
_MODEL_ID = const(0xEACC)

_SOFT_RESET = const(0x0000)
_VHV_LOOP_BOUND = const(0x0008)
_VHV_START = const(0x000B)
_CONFIGURATION = const(0x002D)
_GPIO_STATUS = const(0x0031)
_PHASECAL_TIMEOUT = const(0x004B)
_RANGE_TIMEOUT_A = const(0x005E)
_VCSEL_PERIOD_A = const(0x0060)
_RANGE_TIMEOUT_B = const(0x0061)
_VCSEL_PERIOD_B = const(0x0063)
_VALID_PHASE_HIGH = const(0x0069)
_PERIOD = const(0x006C)
_WINDOW_AND_PHASE = const(0x0078)
_INTERRUPT_CLEAR = const(0x0086)
_MODE_START = const(0x0087)
_RESULT = const(0x0089)
_OSCILLATOR = const(0x00DE)
_BOOT_STATE = const(0x00E5)
_MODEL = const(0x010F)

_STOP, _TIMED = b"\x00", b"\x40"
_VHV_WAIT_MS = const(300)
_BOOT_WAIT_MS = const(50)

# registers 0x2D to 0x87, in rows by what they are for; ST documents only those named here
_DEFAULTS = (
    b"\x00\x01\x01"  # 0x2D: bus pads; bit 0 of 0x2E and 0x2F: pulled up to AVDD, as on breakout boards
    b"\x01\x02"  # 0x30: bit 4 clear, interrupt active high; 0x31: its state
    b"\x00\x02\x08\x00\x08\x10\x01\x01\x00\x00\x00\x00\xff\x00\x0f\x00\x00\x00\x00\x00"
    b"\x20"  # 0x46: interrupt at each new measurement
    b"\x0b\x00\x00\x02\x0a\x21\x00\x00\x05\x00\x00\x00\x00\xc8\x00\x00\x38\xff\x01\x00\x08\x00\x00"
    b"\x01\xcc\x0f\x01\xf1\x0d"  # 0x5E: timeout A, VCSEL period A, timeout B, VCSEL period B
    b"\x01\x68\x00\x80"  # 0x64: limit of sigma, 90 mm; 0x66: limit of the signal, 1 Mcps
    b"\x08\xb8\x00\x00"  # 0x69: valid phase
    b"\x00\x00\x0f\x89"  # 0x6C: period
    b"\x00\x00\x00\x00\x00\x00\x00\x01"  # 0x72: distance thresholds, not used
    b"\x0f\x0d\x0e\x0e\x00\x00\x02"  # 0x78: window and initial phase
    b"\xc7\xff"  # 0x7F: region of interest: centre, all 16 x 16
    b"\x9b\x00\x00\x00\x01"
    b"\x00\x00"  # 0x86: interrupt clear, 0x87: mode start
)

# the short distance mode, up to 1.3 m, in which ambient light matters least; the timeouts are those of the budget, in
# macro periods of these VCSEL periods (mantissa << exponent)
_SHORT_MODE = (
    (_PHASECAL_TIMEOUT, b"\x14"),
    (_VCSEL_PERIOD_A, b"\x07"),
    (_VCSEL_PERIOD_B, b"\x05"),
    (_VALID_PHASE_HIGH, b"\x38"),
    (_WINDOW_AND_PHASE, b"\x07\x05\x06\x06"),
    (_RANGE_TIMEOUT_A, b"\x00\x1d"),
    (_RANGE_TIMEOUT_B, b"\x00\x27"),
)

# the device's 5-bit status to the status codes of UM2356; what that does not know is 14, invalid
_STATUS = (
    b"\x0e\x05\x05\x05\x02\x04\x01\x07\x03\x00\x0e\x0e\x09\x0d\x0e\x0e\x0e\x0e\x0a\x06\x0e\x0e\x0b\x0e" + b"\x0e" * 8
)


class VL53L1X:
    """One sensor on an I2C bus. `begin` makes it range; then, each cycle: `if sensor.ready(): sensor.read()`."""

    budget_us = 1000 * _BUDGET_MS
    """How long a measurement integrates [us]."""
    delay_us = budget_us // 2
    """From the middle of a measurement until it is ready [us]."""
    period_us = 1000 * _PERIOD_MS
    """From the start of a measurement to that of the next [us]."""

    def __init__(self, i2c, time=time):
        self._i2c = i2c
        self._sleep_ms = time.sleep_ms
        self._byte = bytearray(1)
        self._block = bytearray(17)
        self.stream = 0
        """The sensor's count of measurements, from 0 to 255 and then from 128 on again."""
        self.status = 255
        """Status of UM2356: 0 is a valid range; 255 before the first reading."""
        self.mm = 0
        """Distance [mm]."""
        self.sigma = 0
        """Standard deviation of the distance [mm / 4]."""
        self.signal = 0
        """Rate of the signal, crosstalk taken off [Mcps / 128]."""
        self.ambient = 0
        """Rate of ambient light [Mcps / 128]."""
        self.spads = 0
        """SPADs in use [1 / 256]."""

    def begin(self):
        """Reset and set up the sensor and make it range until `stop`; takes some 0.15 s."""
        self._reset()
        self._write(_CONFIGURATION, _DEFAULTS)
        self._calibrate()
        for register, values in _SHORT_MODE:
            self._keep(register, values)
        self._set_period()
        self._write(_MODE_START, _TIMED)

    def ready(self):
        """Whether there is a measurement that was not read."""
        self._read(_GPIO_STATUS, self._byte)
        return bool(self._byte[0] & 1)

    def read(self):
        """Take the newest measurement into `stream` to `spads` and make way for the next; allocates nothing."""
        block = self._block
        self._read(_RESULT, block)
        self._write(_INTERRUPT_CLEAR, b"\x01")
        code = block[0] & 0x1F
        if code == 0 or block[0] == 0xFF:  # the latter is a data line that nobody drives
            raise OSError(_IO, "VL53L1X has measured nothing: it lost its set-up")
        self.status = _STATUS[code]
        self.stream = block[2]
        self.spads = block[3] << 8 | block[4]
        self.ambient = block[7] << 8 | block[8]
        self.sigma = block[9] << 8 | block[10]
        self.mm = block[13] << 8 | block[14]
        self.signal = block[15] << 8 | block[16]

    def stop(self):
        """Stop ranging."""
        self._write(_MODE_START, _STOP)
        self._write(_INTERRUPT_CLEAR, b"\x01")

    def recalibrate(self):
        """Calibrate anew for the present temperature, after which ranging goes on; takes some 0.06 s."""
        self.stop()
        self._write(_VHV_LOOP_BOUND, b"\x81")
        self._write(_VHV_START, b"\x92")
        self._calibrate()
        self._write(_MODE_START, _TIMED)

    def _read(self, register, into):
        self._i2c.readfrom_mem_into(_ADDRESS, register, into, addrsize=16)

    def _write(self, register, data):
        self._i2c.writeto_mem(_ADDRESS, register, data, addrsize=16)

    def _word(self, register):
        return int.from_bytes(self._i2c.readfrom_mem(_ADDRESS, register, 2, addrsize=16), "big")

    def _keep(self, register, data):
        """Write a register and make sure that it holds what was written."""
        self._write(register, data)
        if self._i2c.readfrom_mem(_ADDRESS, register, len(data), addrsize=16) != data:
            raise OSError(_IO, f"VL53L1X does not keep register 0x{register:02x}")

    def _reset(self):
        self._write(_SOFT_RESET, b"\x00")
        self._sleep_ms(1)
        self._write(_SOFT_RESET, b"\x01")
        self._wait(self._booted, _BOOT_WAIT_MS, "does not boot")
        model = self._word(_MODEL)
        if model != _MODEL_ID:
            raise OSError(_NO_DEVICE, f"no VL53L1X: its model is 0x{model:04x}")

    def _booted(self):
        try:
            self._read(_BOOT_STATE, self._byte)
        except OSError:  # it does not answer while it boots; `_wait` ends this
            return False
        return bool(self._byte[0] & 1)

    def _wait(self, condition, most_ms, what):
        for _ in range(most_ms):
            self._sleep_ms(1)
            if condition():
                return
        raise OSError(_TIMEOUT, "VL53L1X " + what)

    def _calibrate(self):
        """Range once, which finds the voltage of the SPADs; the measurements that follow start from that."""
        self._write(_MODE_START, _TIMED)
        self._wait(self.ready, _VHV_WAIT_MS, "does not range")
        self.stop()
        self._write(_VHV_LOOP_BOUND, b"\x09")
        self._write(_VHV_START, b"\x00")

    def _set_period(self):
        # counts of the slow oscillator; 1.075 is ST's own factor
        counts = (self._word(_OSCILLATOR) & 0x3FF) * _PERIOD_MS * 43 // 40
        if counts == 0:
            raise OSError(_IO, "VL53L1X does not know the rate of its oscillator")
        self._keep(_PERIOD, counts.to_bytes(4, "big"))
