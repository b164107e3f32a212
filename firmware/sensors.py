"""The sensors of a unit, watched: what fails is counted and told.

A sensor that fails or falls silent is begun anew, after pauses that grow, while the other goes on.
"""

import wire
from micropython import const

_CYCLE_US = const(20_000)
_ERRORS_IN_A_ROW = const(3)
_FIRST_PAUSE_US = const(100_000)
_LONGEST_PAUSE_US = const(5_000_000)
_SILENT_US = const(300_000)
_FORGET_US = const(10_000_000)
_MOST_ERRORS = const(0xFFFF)
_WARMER_CDEG = const(800)


class Bus:
    """Counts the failed transfers of both sensors, up to 65535."""

    def __init__(self):
        self.errors = 0

    def fail(self):
        """Count one."""
        self.errors = min(self.errors + 1, _MOST_ERRORS)


class Watched:
    """What the two on the bus have in common. `begin()` starts the sensor; an OSError is a fault of the bus."""

    ERROR = RESTARTED = 0

    def __init__(self, begin, clock, bus):
        self._begin = begin
        self._clock = clock
        self._bus = bus
        self._up = False
        self._errors = 0
        self._pause = _FIRST_PAUSE_US
        self._flags = 0
        self._fresh = self._next = clock.ticks()

    def _due(self, now):
        """Whether the sensor runs and is to be asked; begins it when that is due."""
        if self._clock.diff(now, self._next) < 0:
            return False
        if not self._up:
            self._start(self._begin)
            return False
        return True

    def _nothing(self, now):
        """It answered, and has nothing: too long, and it is begun anew."""
        self._errors = 0
        if self._clock.diff(now, self._fresh) > _SILENT_US:
            self._stop()

    def _start(self, begin):
        try:
            begin()
        except OSError:
            self._note_error()
            self._stop()
            return
        self._up = True
        self._errors = 0
        self._flags |= self.RESTARTED
        self._fresh = self._next = self._clock.ticks()
        self._begun()

    def _begun(self):
        """Forget what was known of the sensor before it began anew."""

    def _stop(self):
        self._up = False
        self._next = self._clock.add(self._clock.ticks(), self._pause)
        self._pause = min(2 * self._pause, _LONGEST_PAUSE_US)

    def _note_error(self):
        self._flags |= self.ERROR
        self._bus.fail()

    def _fail(self):
        self._note_error()
        self._errors += 1
        if self._errors >= _ERRORS_IN_A_ROW:
            self._stop()

    def _well(self):
        """Count as running: it has given something."""
        self._errors = 0
        self._pause = _FIRST_PAUSE_US

    def take_flags(self):
        """Return what happened since the last call; a sensor that failed and is not running fails on."""
        flags = self._flags
        self._flags = 0 if self._up else flags & self.ERROR
        return flags


class RangeFinder(Watched):
    """The range finder of a unit: the newest measurement, how old its middle is at most. `new`: it waits to be told.

    `zones` are those of a device that has some, as they stand in a sample, else nothing.
    """

    ERROR, RESTARTED = wire.RANGE_BUS_ERROR, wire.RANGE_RESTARTED

    def __init__(self, device, clock, bus):
        super().__init__(device.begin, clock, bus)
        self._device = device
        self.zones = getattr(device, "zones", b"")
        self._stream = None
        self._known = False
        self._calibrated_cdeg = None
        self.new = False
        self._empty = self._middle = self._fresh

    def _begun(self):
        self._stream = self._calibrated_cdeg = None
        self._empty = self._fresh

    def step(self, now):
        """Take in a measurement if there is one. Cheap when none can be there yet."""
        if not self._due(now):
            return
        device = self._device
        try:
            if not device.ready():
                self._empty = now
                self._nothing(now)
                return
            device.read()
        except OSError:
            self._next = self._clock.add(self._clock.ticks(), _CYCLE_US)
            self._fail()
            return
        if device.stream == self._stream:
            self._nothing(now)
        else:
            self._take(now)

    def look_at_temperature(self, cdeg):
        """Calibrate the sensor anew if it is 8 degrees C from where that was done last, as ST asks; one told first."""
        if not self._up or cdeg == wire.NO_TEMPERATURE:
            return
        if self._calibrated_cdeg is None:
            self._calibrated_cdeg = cdeg
        elif abs(cdeg - self._calibrated_cdeg) >= _WARMER_CDEG:
            self._start(self._device.recalibrate)

    def _take(self, now):
        """Store the measurement. It became ready after the last look that found none.

        The next cannot end sooner than most of a period after this one, which bounds its age even if nobody looks.
        """
        device = self._device
        self._stream = device.stream
        self._middle = self._clock.add(self._empty, -device.delay_us)
        self._next = self._clock.add(self._empty, device.period_us * 9 // 10)
        self._empty = self._next if self._clock.diff(self._next, now) > 0 else now
        self._fresh = now
        self.new = self._known = True
        self._well()

    def put(self, sample, now):
        """Tell the newest measurement, and the flags, in a sample as of now."""
        age = self._clock.diff(now, self._middle) if self._known else _FORGET_US
        late = not self._up or self._clock.diff(now, self._fresh) > 2 * self._device.period_us
        if age >= _FORGET_US:
            self._known = False
            sample.range_status, sample.range_age_us = wire.NO_RANGE, wire.LONGEST_US
        elif self.new:
            device = self._device
            sample.range_stream, sample.range_status, sample.range_mm = device.stream, device.status, device.mm
            sample.range_sigma, sample.range_signal = device.sigma, device.signal
            sample.range_ambient, sample.range_spads = device.ambient, device.spads
            if self.zones:
                sample.zones = self.zones
                sample.flags |= wire.ZONES
        if self._known:
            sample.range_age_us = age
        sample.flags |= self.take_flags() | (wire.RANGE_NEW if self.new else 0) | (wire.RANGE_LATE if late else 0)
        self.new = False


class Imu(Watched):
    """The LSM6DS3 of a unit: what its FIFO holds, numbered from the first on, and how old the newest is."""

    ERROR, RESTARTED = wire.IMU_BUS_ERROR, wire.IMU_RESTARTED

    def __init__(self, device, clock, bus):
        super().__init__(device.begin, clock, bus)
        self._device = device
        self._count = self._index = 0
        self._read_at = self._fresh
        self._read_us = None
        self.temperature_cdeg = wire.NO_TEMPERATURE
        """As it was looked at last."""

    def _begun(self):
        """Count what it missed since it was read last as lost."""
        if self._read_us is not None:
            away = self._clock.us(self._fresh) - self._read_us
            self._lose(away * self._device.rate_hz // 1_000_000)

    def _lose(self, samples):
        self._index += samples
        self._flags |= wire.IMU_LOST

    def step(self, into, now):
        """Take what the FIFO holds, at most `IMU_MOST` samples, into a buffer."""
        self._index += self._count
        self._count = 0
        if not self._due(now):
            return
        try:
            self._count = self._device.drain(into, wire.IMU_MOST)
        except OSError:
            self._fail()
            return
        self._read_at = self._clock.ticks()
        if self._device.lost:
            self._lose(self._device.lost)
        if self._count:
            self._fresh = self._read_at
            self._read_us = self._clock.us(self._read_at)
            self._well()
        else:
            self._nothing(now)

    def look_at_temperature(self):
        """Read the sensor's temperature anew."""
        self.temperature_cdeg = wire.NO_TEMPERATURE
        if not self._up:
            return
        try:
            self.temperature_cdeg = self._device.temperature_cdeg()
        except OSError:
            self._fail()

    def put(self, sample, now):
        """Tell how many samples were taken and when, the temperature and the flags, in a sample as of now."""
        device = self._device
        sample.imu_count, sample.imu_index = self._count, self._index
        sample.imu_scale, sample.imu_rate_hz = device.scale_code, device.rate_hz
        sample.temperature_cdeg = self.temperature_cdeg
        sample.imu_age_us = wire.LONGEST_US
        if self._count:
            half_periods = 2 * device.waiting + 1
            sample.imu_age_us = self._clock.diff(now, self._read_at) + half_periods * 500_000 // device.rate_hz
        sample.flags |= self.take_flags()


class Touch:
    """The touch sensor of a unit, looked at in each pass. `new`: a touch that began or ended waits to be told."""

    def __init__(self, device, clock):
        self._device = device
        self._clock = clock
        self._looked = clock.ticks()
        self.new = False

    def step(self, now):
        """Look at it."""
        self._looked = now
        if self._device.look():
            self.new = True

    def put(self, sample, now):
        """Tell what it showed last in a sample as of now."""
        device = self._device
        sample.flags |= wire.TOUCH
        sample.touch_contact = int(device.touched)
        sample.touch_status = wire.TOUCH_FAILED if device.failed else wire.TOUCH_OK
        sample.touch_raw_mv = device.mv
        sample.touch_force_mn = wire.NO_FORCE if device.failed else device.mn
        sample.touch_age_us = self._clock.diff(now, self._looked)
        self.new = False
