"""A clock that tests advance, and an I2C bus with fake devices on it, as `machine.I2C` shows them.

What a real device would take without a word and do wrong, a fake refuses: `Refused`, which is no OSError, so that no
driver can swallow it.
"""

NO_ANSWER = 19
"""ENODEV: what MicroPython raises where nobody acknowledges."""
TIMED_OUT = 110
"""ETIMEDOUT: what it raises where the clock line is held down."""


class Refused(Exception):
    """A driver did what the data sheet forbids."""


class Clock:
    """Time since the start of the test; stands for the module `time`, too."""

    PERIOD = 1 << 30

    def __init__(self, start_us=0):
        self.now_us = start_us

    def advance(self, us):
        self.now_us += us

    def sleep_ms(self, ms):
        self.now_us += 1000 * ms

    def ticks_us(self):
        """Ticks that wrap as on the ESP8266."""
        return self.now_us % self.PERIOD

    def ticks_add(self, ticks, delta):
        return (ticks + delta) % self.PERIOD

    def ticks_diff(self, end, start):
        return (end - start + self.PERIOD // 2) % self.PERIOD - self.PERIOD // 2


class Device:
    """A device on the bus. Each has `address_bits` of its registers, `read(register, count)`, `write(register, data)`,
    and `_clear()`, which is called when it gets its power."""

    def __init__(self, clock, address):
        self.address, self._clock, self._powered = address, clock, True
        self._clear()

    def power_off(self):
        self._powered = False

    def power_on(self):
        self._powered = True
        self._clear()

    def answers(self):
        return self._powered


class Bus:
    """The bus. Each transfer takes its time; faults are there on demand."""

    us_per_byte = 25
    """A byte takes 9 bits: 22.5 us at 400 kHz."""

    def __init__(self, clock, *devices):
        self.clock = clock
        self.transfers = 0
        self.fail_at = 0
        """Number of the transfer that fails, from 1 on; 0: none."""
        self.stuck = False
        """The clock line is held down: no transfer ends."""
        self.held = None
        """The data line is not the device's own: this tells each byte that is read, what is written vanishes, and no
        transfer fails. So it is where that line is held down, as its level counts as the acknowledgement."""
        self._devices = devices
        self._fail_next = self._break_next = 0

    def fail_next(self, count):
        """Let so many transfers fail."""
        self._fail_next = count

    def break_next(self, count):
        """Let so many transfers fail at their end: the device has done its part, the driver gets nothing."""
        self._break_next = count

    def readfrom_mem(self, address, register, count, *, addrsize=8):
        buffer = bytearray(count)
        self.readfrom_mem_into(address, register, buffer, addrsize=addrsize)
        return bytes(buffer)

    def readfrom_mem_into(self, address, register, buffer, *, addrsize=8):
        device = self._transfer(address, register, len(buffer), addrsize)
        data = device.read(register, len(buffer)) if device else [self.held() for _ in buffer]
        self._break_off()
        for i in range(len(buffer)):
            buffer[i] = data[i]

    def writeto_mem(self, address, register, data, *, addrsize=8):
        device = self._transfer(address, register, len(data), addrsize)
        if device:
            device.write(register, bytes(data))
        self._break_off()

    def _break_off(self):
        if self._break_next:
            self._break_next -= 1
            raise OSError(TIMED_OUT)

    def _transfer(self, address, register, count, addrsize):
        self.transfers += 1
        if self.stuck:
            raise OSError(TIMED_OUT)
        self.clock.advance(self.us_per_byte)
        if self.held:
            self.clock.advance(self.us_per_byte * (count + 2))
            return None
        if self._fail_next or self.transfers == self.fail_at:
            self._fail_next = max(self._fail_next - 1, 0)
            raise OSError(NO_ANSWER)
        for device in self._devices:
            if address == device.address and device.answers():
                if addrsize != device.address_bits:
                    raise Refused(f"registers of 0x{address:02x} have {device.address_bits} bits")
                if count == 0 or not 0 <= register < 1 << addrsize:
                    raise Refused(f"register 0x{register:x}, {count} bytes")
                self.clock.advance(self.us_per_byte * (count + 2))
                return device
        raise OSError(NO_ANSWER)


def driven(driver, fake, start_us=0, **faults):
    """Return clock, bus, fake device and a driver of it."""
    clock = Clock(start_us)
    device = fake(clock, **faults)
    bus = Bus(clock, device)
    clock.advance(10_000)
    return clock, bus, device, driver(bus, time=clock)


def error_of(action, *arguments, kind=OSError):
    """Return what an error of an action says first; no error is one."""
    try:
        action(*arguments)
    except kind as error:
        return error.args[0]
    raise AssertionError("no error")
