"""The VL53L5CX at the level of its registers, with time: pages, a program that is loaded, a mailbox, frames of results.

What it does with what it is sent is from ST's driver (UM2884, STSW-IMG023): a program in three pages, structures of its
program by index behind a header and before a footer, words with the highest byte first. It refuses (`Refused`) what
leaves that way, and ranges only with all that the driver of ST sends.
"""

import struct

from fake_bus import Device, Refused

PROGRAM = bytes((7 * k + (k >> 8)) & 0xFF for k in range(1024)) * 84
CONFIGURATION = bytes(k % 251 for k in range(972))
CROSSTALK = bytes(k % 13 for k in range(776))
FILE = b"PTL5" + PROGRAM + CONFIGURATION + CROSSTALK
NVM = bytes((3 * k) & 0x7F for k in range(492))
_GET_NVM = bytes.fromhex("540000409e1400c09e2001409e3400409e3804049f3804029fb801009fc801000000000f02020024")
_MIDDLE = {0x54B4: 12, 0x54C0: 4}
_BYTES = {0x54D0: 4, 0xDB84: 1, 0xDEC4: 2, 0xDF44: 2, 0xE084: 1}
BOOT_US = 60_000


class FakeVl53l5cx(Device):
    """The device. `target(us)` gives what each zone sees: (status, targets, quarters of a mm, mm / 128, ambient)."""

    address_bits = 16

    def __init__(self, clock, revision=2):
        self.target = lambda us: [(5, 1, 4 * (100 + k), 128 * 3, 16 * 20) for k in range(self.side**2)]
        self._revision = revision
        self.corrupt = False
        """Whether the next frames are torn."""
        self.sends = {}
        """Structures by index, and grids by their address, as they were sent."""
        super().__init__(clock, 0x29)

    def _clear(self):
        self._page, self._memory = 0, {9: bytearray(0x8000), 10: bytearray(0x8000), 11: bytearray(0x5000)}
        self._booted_us = self._clock.now_us + BOOT_US
        self._runs = self._stopped = False
        self._answer, self._status = b"", bytes(4)
        self._structures = {}
        self._began, self._stream = None, 255
        self.sends.clear()

    @property
    def ranging(self):
        return self._began is not None

    # the bus

    def read(self, register, count):
        if register == 0x7FFF:
            return bytes([self._page])
        if self._page == 0:
            values = {0: 0xF0, 1: self._revision, 6: self._go(), 7: 0}
            return bytes(values.get(register + k, 0) for k in range(count))
        if self._page == 1 and register == 0x21:
            return b"\x10"
        if self._page != 2:
            raise Refused(f"read of 0x{register:04x} in page {self._page}")
        if register == 0x2C00:
            return self._status[:count]
        if register == 0x2C04:
            return (self._answer + bytes(count))[:count]
        if register == 0 and self.ranging:
            return self._results(count)
        return bytes(count)

    def _go(self):
        if self._stopped:
            return 0x80
        return int(self._runs or self._clock.now_us >= self._booted_us)

    def write(self, register, data):
        if register == 0x7FFF:
            self._page = data[0]
        elif self._page in self._memory:
            self._memory[self._page][register : register + len(data)] = data
            if register + len(data) > len(self._memory[self._page]):
                raise Refused("a program beyond its memory")
        elif self._page == 0:
            self._write_control(register, data[0])
        elif self._page == 2 and self._runs and register >= 0x2C00:
            self._take(register, data)

    def _write_control(self, register, value):
        if register == 0x000F and value == 0x43:
            self._clear()
        elif register == 0x000B and value == 1:
            loaded = b"".join(bytes(self._memory[k]) for k in (9, 10, 11))
            self._runs = loaded == PROGRAM
        elif register == 0x0014:
            self._stopped = value == 1
            if value:
                self._began = None

    # the mailbox

    def _take(self, register, data):
        self._status = b"\x00\x03\x00\x00"
        if register == 0x2FD8:
            self._refuse_unless(data == _GET_NVM)
            self._answer, self._status = NVM, b"\x02\x03\x00\x00"
        elif register in (0x2C34, 0x2CF8, 0x2E18):
            self._refuse_unless(len(data) == {0x2C34: 972, 0x2CF8: 776, 0x2E18: 488}[register])
            self.sends[register] = data
        elif register == 0x2FFC:
            self._refuse_unless(data == b"\x00\x03\x00\x00")
            self._range()
        else:
            self._structure(register, data)

    def _structure(self, register, data):
        index, size = struct.unpack(">HH", data[:4])
        size >>= 4
        self._refuse_unless(register + len(data) == 0x3000)
        if data[4:] == struct.pack(">IHH", 0x0F, 2, 8):
            found = self._structures.get(index, bytes(size))
            self._answer = data[:4] + found + bytes(8)
            return
        self._refuse_unless(data[4 + size :] == struct.pack(">IHH", 0x0F, 0x0501, size + 8))
        self._structures[index] = self.sends[index] = data[4 : 4 + size]

    @staticmethod
    def _refuse_unless(well):
        if not well:
            raise Refused("not as ST's driver sends it")

    def part(self, index, at):
        """A byte of a structure, in the order of ST's driver."""
        return self._structures[index][at ^ 3]

    def _range(self):
        self._refuse_unless({0x2C34, 0x2CF8, 0x2E18, 0xDB80, 0xD964, 0xE108, 0xD980, 0xD968, 0xD970} <= set(self.sends))
        self._refuse_unless(self.sends[0x2C34] == CONFIGURATION)
        self.side = self.part(0x5450, 0)
        self._refuse_unless((self.part(0x5450, 1), self.part(0xAE64, 0)) == (self.side, 1))
        listed = self._structures[0xD980]
        enabled = struct.unpack(">I", self._structures[0xD970][:4])[0]
        self._blocks = []
        size = 24
        for bit in range(len(listed) // 4):
            index, rest = struct.unpack(">HH", listed[4 * bit : 4 * bit + 4])
            if not enabled >> bit & 1:
                continue
            kind, count = rest & 15, rest >> 4
            length = kind * count if 1 <= kind < 13 else count
            size += 4 + length
            if index:
                self._refuse_unless(length == (_MIDDLE.get(index) or _BYTES[index] * self.side**2))
                self._blocks.append((index, rest, length))
        self._size = size
        self._structures[0x5440] = bytes(10) + struct.pack(">H", size)
        self._refuse_unless(struct.unpack(">I", self._structures[0xD968][:4])[0] == size)
        self._began, self._stream = self._clock.now_us, 255

    # results

    @property
    def period_us(self):
        return 1_000_000 // self.part(0x5458, 1)

    def _results(self, count):
        done = (self._clock.now_us - self._began) // self.period_us
        if not done:
            return (b"\xff\x05\x05\x10" + bytes(count))[:count]
        self._stream = (done - 1) % 255
        number = struct.pack(">H", done & 0xFFFF)
        frame = bytes([self._stream, 5, 5, 0x10]) + bytes(6) + number + bytes(4)
        zones = self.target(self._began + done * self.period_us - self.period_us // 2)
        for index, rest, length in self._blocks:
            frame += struct.pack(">HH", index, rest) + self._block(index, length, zones)
        frame += bytes(10) + (b"\xab\xcd" if self.corrupt else number)
        assert len(frame) == self._size
        return (frame + bytes(count))[:count]

    def _block(self, index, length, zones):
        if index not in _BYTES:
            return bytes(length)
        at = {0xE084: 0, 0xDB84: 1, 0xDF44: 2, 0xDEC4: 3, 0x54D0: 4}[index]
        kind = {1: "<B", 2: "<h", 4: "<I"}[_BYTES[index]]
        plain = b"".join(struct.pack(kind, zone[at]) for zone in zones)
        return bytes(plain[k ^ 3] for k in range(length))
