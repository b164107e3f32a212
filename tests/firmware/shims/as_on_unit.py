"""Adds to CPython's `time` and `sys` what MicroPython's have besides."""

import sys
import time
import traceback

TICKS_PERIOD = 1 << 30

time.ticks_us = lambda: time.monotonic_ns() // 1000 % TICKS_PERIOD
time.ticks_add = lambda ticks, delta: (ticks + delta) % TICKS_PERIOD
time.ticks_diff = lambda end, start: (end - start + TICKS_PERIOD // 2) % TICKS_PERIOD - TICKS_PERIOD // 2
time.sleep_ms = lambda ms: time.sleep(ms / 1e3)
time.sleep_us = lambda us: time.sleep(us / 1e6)

sys.print_exception = lambda error, file=None: traceback.print_exception(error, file=file or sys.stdout)
