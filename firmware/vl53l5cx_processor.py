"""The processor of a VL53L5CX: its program loaded from the unit's flash, and the structures it is set up by.

Facts from ST, as of vl53l5cx.py. Each 4 bytes of the device are a word, highest byte first: byte k of the structures in
ST's driver is byte k ^ 3 here.
"""

import struct

from micropython import const

FILE = "vl53l5cx.bin"
"""ST's program (86 016 bytes), configuration (972) and cross-talk (776), one after the other, behind a mark."""
_MARK = b"PTL5"
_PROGRAM, _CONFIGURATION, _CROSSTALK, _OFFSETS = const(0x15000), const(972), const(776), const(488)
_FILE_SIZE = const(87768)
_CHUNK = const(1024)

_NO_FILE, _NO_DEVICE, _IO, _TIMEOUT = const(2), const(19), const(5), const(110)
_WAIT_MS = const(2000)
_POLL_MS = const(10)

_PAGE = const(0x7FFF)
_STATUS, _ANSWER, _COMMAND_END = const(0x2C00), const(0x2C04), const(0x3000)
_SEND_CONFIGURATION, _SEND_CROSSTALK, _SEND_OFFSETS = const(0x2C34), const(0x2CF8), const(0x2E18)
_DONE = const(3)
_REFUSED = const(0x7F)
_PIPE, _SINGLE, _GLARE = const(0xDB80), const(0xD964), const(0xE108)

# registers and values to reach the processor, -1 to read: at power-on, before and after its program is loaded
_REBOOT = (
    (0x0009, 4), (0x000F, 0x40), (0x000A, 3), (_PAGE, -1), (0x000C, 1), (0x0101, 0), (0x0102, 0), (0x010A, 1),
    (0x4002, 1), (0x4002, 0), (0x010A, 3), (0x0103, 1), (0x000C, 0), (0x000F, 0x43),
)  # fmt: skip
_POWER = (
    (_PAGE, -1), (0x000C, 1), (0x0101, 0), (0x0102, 0), (0x010A, 1), (0x4002, 1), (0x4002, 0), (0x010A, 3), (0x0103, 1),
    (0x400F, 0), (0x021A, 0x43), (0x021A, 3), (0x021A, 1), (0x021A, 0), (0x0219, 0), (0x021B, 0), (_PAGE, -1),
    (0x000C, 0),
)  # fmt: skip
_RUN = (
    (_PAGE, -1), (0x000C, 1), (0x0114, 0), (0x0115, 0), (0x0116, 0x42), (0x0117, 0), (0x000B, 0), (_PAGE, -1),
    (0x000C, 0), (0x000B, 1),
)  # fmt: skip
_READ_CALIBRATION = (
    b"\x54\x00\x00\x40\x9e\x14\x00\xc0\x9e\x20\x01\x40\x9e\x34\x00\x40\x9e\x38\x04\x04\x9f\x38\x04\x02"
    b"\x9f\xb8\x01\x00\x9f\xc8\x01\x00\x00\x00\x00\x0f\x02\x02\x00\x24"
)
_OFFSETS_END = b"\x00\x00\x00\x0f\x03\x01\x01\xe4"


class Processor:
    """Registers and structures of one device on an I2C bus. `feed` is called all along; `buffer` has 1024 bytes."""

    def __init__(self, i2c, address, sleep_ms, feed, buffer):
        self._i2c = i2c
        self._address = address
        self._sleep_ms = sleep_ms
        self._feed = feed
        self._block = buffer
        self._four = bytearray(4)
        self._offsets = self._crosstalk = None

    def load(self):
        """Reset the device, load its program, and send what it was calibrated to and ST's settings."""
        with _opened() as file:
            self._identify()
            self._boot(file)
            self._configure(file)

    def range(self):
        """Start to range."""
        self._page(0)
        self._writes(((0x0009, 5),))
        self._page(2)
        self._write(_COMMAND_END - 4, b"\x00\x03\x00\x00")
        self._answered("does not range")

    def stop(self):
        """Stop ranging; its program and settings stay."""
        self._page(0)
        self._writes(((0x0015, 0x16), (0x0014, 1)))
        self._wait(0x0006, 0x80, 0x80, "does not stop")
        self._page(0)
        self._writes(((0x0014, 0), (0x0015, 0), (0x0009, 4)))
        self._page(2)

    # registers

    def _write(self, register, data):
        self._i2c.writeto_mem(self._address, register, data, addrsize=16)

    def _page(self, number):
        self._write(_PAGE, bytes([number]))

    def _writes(self, pairs):
        for register, value in pairs:
            if value < 0:
                self._i2c.readfrom_mem(self._address, register, 1, addrsize=16)
            else:
                self._write(register, bytes([value]))

    def _wait(self, register, mask, value, what, size=1, at=0):
        """Wait until a byte of an answer is so."""
        buffer = memoryview(self._four)[:size]
        for _ in range(_WAIT_MS // _POLL_MS):
            self._feed()
            self._i2c.readfrom_mem_into(self._address, register, buffer, addrsize=16)
            if size == 4 and buffer[2] >= _REFUSED:
                raise OSError(_IO, "VL53L5CX " + what + ": refused")
            if buffer[at] & mask == value:
                return
            self._sleep_ms(_POLL_MS)
        raise OSError(_TIMEOUT, "VL53L5CX " + what)

    def _answered(self, what, at=1, value=_DONE):
        self._wait(_STATUS, 0xFF, value, what, 4, at)

    # set-up

    def _identify(self):
        self._page(0)
        found = self._i2c.readfrom_mem(self._address, 0, 2, addrsize=16)
        self._page(2)
        if found != b"\xf0\x02":
            raise OSError(_NO_DEVICE, f"no VL53L5CX: it is 0x{found[0]:02x}{found[1]:02x}")

    def _boot(self, file):
        self._page(0)
        self._writes(_REBOOT)
        self._sleep_ms(1)
        self._writes(((0x000F, 0x40), (0x000A, 1)))
        self._sleep_ms(100)
        self._wait(0x0006, 0xFF, 1, "does not boot")
        self._writes(((0x000E, 1),))
        self._access()
        self._writes(_POWER)
        self._page(1)
        self._writes(((0x0020, 7), (0x0020, 6)))
        self._load(file)
        self._access()
        self._writes(_RUN)
        for _ in range(500):
            state = self._i2c.readfrom_mem(self._address, 0x0006, 1, addrsize=16)[0]
            if state & 0x80 and self._i2c.readfrom_mem(self._address, 0x0007, 1, addrsize=16)[0]:
                raise OSError(_IO, "VL53L5CX does not take its program")
            if state & 0x81:
                break
            self._sleep_ms(1)
        else:
            raise OSError(_TIMEOUT, "VL53L5CX does not start its program")
        self._page(2)

    def _access(self):
        """Open the way to the processor's memory."""
        self._page(2)
        self._writes(((0x0003, 0x0D),))
        self._page(1)
        self._wait(0x0021, 0x10, 0x10, "gives no access")
        self._page(0)

    def _load(self, file):
        for at in range(0, _PROGRAM, _CHUNK):
            if at % 0x8000 == 0:
                self._page(9 + at // 0x8000)
            _fill(file, self._block)
            self._write(at % 0x8000, self._block)
            self._feed()

    def _configure(self, file):
        self._write(_COMMAND_END - len(_READ_CALIBRATION), _READ_CALIBRATION)
        self._answered("gives no calibration", 0, 2)
        self._offsets = self._i2c.readfrom_mem(self._address, _ANSWER, _OFFSETS + 4, addrsize=16)
        configuration = bytearray(_CONFIGURATION)
        _fill(file, configuration)
        self._crosstalk = bytearray(_CROSSTALK)
        _fill(file, self._crosstalk)
        self.send_grids(4)
        self._write(_SEND_CONFIGURATION, configuration)
        self._answered("does not take its configuration")
        self.write(_PIPE, b"\x00\x01\x00\x01")
        self.write(_SINGLE, b"\x00\x00\x00\x01")
        self.replace(_GLARE, 40, 0x26, b"\x01")
        self.replace(_GLARE, 40, 0x25, b"\x01")

    def forget_grids(self):
        """Give back the room of calibrated grids: they are sent."""
        self._offsets = self._crosstalk = None

    def send_grids(self, side):
        """Send calibrated offsets and cross-talk, of 4 x 4 zones as means of the 8 x 8 there are."""
        offsets = bytearray(self._offsets)
        crosstalk = bytearray(self._crosstalk)
        if side == 4:
            offsets[0x10:0x18] = b"\x0f\x04\x04\x00\x08\x10\x10\x07"
            _mean(offsets, 0x3C, 4)
            _mean(offsets, 0x140, 2)
            crosstalk[0x08:0x10] = b"\x0f\x04\x04\x17\x08\x10\x10\x07"
            crosstalk[0x20:0x28] = b"\x00\x78\x00\x08\x00\x00\x00\x08"
            _mean(crosstalk, 0x34, 4)
            crosstalk[0x134:0x138] = b"\xa0\xfc\x01\x00"
        self._write(_SEND_OFFSETS, offsets[8:_OFFSETS] + _OFFSETS_END)
        self._answered("does not take its offsets")
        self._write(_SEND_CROSSTALK, crosstalk)
        self._answered("does not take its cross-talk")

    # the structures of its program

    def read(self, index, size):
        """Return a structure."""
        self._write(_COMMAND_END - 12, struct.pack(">HHIHH", index, size << 4, 0x0F, 0x0002, 0x0008))
        self._answered("does not tell its settings")
        return bytearray(self._i2c.readfrom_mem(self._address, _ANSWER, size + 12, addrsize=16)[4 : 4 + size])

    def write(self, index, data):
        """Set a structure."""
        size = len(data)
        whole = struct.pack(">HH", index, size << 4) + data + struct.pack(">IHH", 0x0F, 0x0501, size + 8)
        self._write(_COMMAND_END - len(whole), whole)
        self._answered("does not take a setting")

    def replace(self, index, size, at, value):
        """Set bytes of a structure, from a place in ST's order on."""
        data = self.read(index, size)
        for k in range(len(value)):
            data[(at + k) ^ 3] = value[k]
        self.write(index, data)


def _opened():
    """Open the program's file behind its mark; one that is missing or not whole is an OSError that says so."""
    try:
        file = open(FILE, "rb")  # noqa: SIM115 the caller closes it
    except OSError:
        raise OSError(_NO_FILE, "copy vl53l5cx.bin to the unit: tools/vl53l5cx_bin.py makes it") from None
    size = file.seek(0, 2)
    file.seek(0)
    if size != _FILE_SIZE or file.read(4) != _MARK:
        file.close()
        raise OSError(_NO_FILE, f"vl53l5cx.bin is {size} bytes or not marked PTL5: make it anew, {_FILE_SIZE} bytes")
    return file


def _fill(file, buffer):
    if file.readinto(buffer) != len(buffer):
        raise OSError(_NO_FILE, "vl53l5cx.bin ends too soon")


def _mean(words, at, size):
    """Put the means of 2 x 2 of 8 x 8 numbers (4 bytes, or 2 with a sign, in words) in the place of the first 16."""
    kind = ">I" if size == 4 else ">h"
    swap = 0 if size == 4 else 1
    read = [struct.unpack_from(kind, words, at + size * (k ^ swap))[0] for k in range(64)]
    for k in range(64):
        mean = 0
        if k < 16:
            first = 2 * (k % 4) + 16 * (k // 4)
            total = read[first] + read[first + 1] + read[first + 8] + read[first + 9]
            mean = -(-total // 4) if total < 0 else total // 4
        struct.pack_into(kind, words, at + size * (k ^ swap), mean)
