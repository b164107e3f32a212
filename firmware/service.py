"""The life of a unit from one reset to the next: in its network, measuring until something fails."""

import io
import sys
import time

from board import address, open_socket, this_board
from clock import Clock
from config import ConfigError, load
from fsr import ForceResistor
from link import Link
from lsm6ds3 import LSM6DS3
from micropython import const
from sensors import Bus, Imu, RangeFinder, Touch
from unit import Unit
from vl53l1x import VL53L1X
from wifi import Datagrams, Station

VERSION = "0.1"
_VERSION_ON_WIRE = const(1)
_WINDOW_MS = const(3000)


def run():
    """Serve until something fails, note what, and begin anew. Ctrl-C, or no configuration, leads to the prompt."""
    board = this_board()
    print("pretouch", VERSION, board.noted())
    try:
        config = load()
    except ConfigError as error:
        print(error)
        return
    try:
        time.sleep_ms(_WINDOW_MS)  # somebody at the serial line gets in: later the watchdog cuts them off
        serve(board, Clock(time), config)
    except Exception as error:
        try:
            board.note(trace(error))
        finally:
            board.reset()


def serve(board, clock, config):
    """Measure and send for ever. The watchdog is fed once a pass, so a pass that never ends begins the unit anew."""
    watchdog = board.open_watchdog()
    board.full_speed()
    station = Station(board.open_wlan(), config.ssid, config.password, clock)
    unit = build(board, clock, config, watchdog.feed)
    while True:
        watchdog.feed()
        station.step(clock.ticks())
        unit.step()
        time.sleep_ms(1)


def build(board, clock, config, feed):
    """Return the unit of a configuration; `feed` feeds the watchdog in what takes long."""
    port = Datagrams(open_socket, address(config.host, config.port))
    link = Link(config.unit, config.key, port, clock, board.draw, _VERSION_ON_WIRE, board.reset_cause())
    i2c, bus = board.open_bus(), Bus()
    range_finder = RangeFinder(range_finder_of(i2c, config, feed), clock, bus)
    imu = Imu(LSM6DS3(i2c), clock, bus)
    battery = board.open_battery(config.battery_full_mv)
    return Unit(config.unit, link, range_finder, imu, bus, clock, battery, touch_of(board, clock, config))


def range_finder_of(i2c, config, feed):
    """Return the driver of the range finder of a configuration; one with zones is loaded where there is one."""
    if config.zones == 1:
        return VL53L1X(i2c)
    from vl53l5cx import VL53L5CX

    return VL53L5CX(i2c, config.zones, 60 if config.sensor == "vl53l7cx" else 45, feed)


def touch_of(board, clock, config):
    """Return the touch sensor of a configuration; None of one without, and where the board has no pin for it."""
    if not config.touch_ohm:
        return None
    if board.TOUCH < 0:
        board.note("this board has no pin for a touch sensor")
        return None
    device = ForceResistor(board.open_touch(), config.touch_ohm, config.touch_mn_per_us, config.touch_least_mn)
    return Touch(device, clock)


def trace(error):
    """Return what an error says of itself and where it came from; no error here knows key or password."""
    text = io.StringIO()
    sys.print_exception(error, text)
    return text.getvalue()
