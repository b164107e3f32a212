"""The wall clock of a process, with steps: how far it is off stands in the file that PRETOUCH_SOAK_CLOCK names."""

import mmap
import os
import struct
import time

with open(os.environ["PRETOUCH_SOAK_CLOCK"], "rb") as _file:  # at the start of every process
    _off = mmap.mmap(_file.fileno(), 8, access=mmap.ACCESS_READ)
_time, _time_ns = time.time, time.time_ns


def _seconds() -> float:
    return float(struct.unpack("<d", _off[:8])[0])


time.time = lambda: _time() + _seconds()
time.time_ns = lambda: _time_ns() + int(1e9 * _seconds())
