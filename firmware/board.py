"""The boards a unit can be built on, an ESP32-C3 or the paper's ESP8266 (D1 mini): the only file that knows them."""

import os
import socket
import sys
import time

import machine
import network
from micropython import const

_BUS_HZ = const(400_000)
_CLOCKS = const(9)
_HALF_BIT_US = const(2)
_WATCHDOG_MS = const(3000)
_NOTE = const(200)
_SOFTWARE_WATCHDOG = const(3)
_ADC_FULL_MV = const(2500)
"""What counts as the range of the ADC of an ESP32-C3 [mV]; it is linear up to 2450."""
_CAUSES = ("PWRON_RESET", "HARD_RESET", "WDT_RESET", "DEEPSLEEP_RESET", "SOFT_RESET")


class Board:
    """What both boards do alike. GPIO numbers: `SDA`, `SCL`, `BATTERY`, `TOUCH`; -1 where there is none."""

    SDA = SCL = BATTERY = TOUCH = -1

    def open_bus(self):
        """Return the I2C bus, freed from a sensor that was cut off in the middle of a byte."""
        sda = machine.Pin(self.SDA, machine.Pin.IN)
        scl = machine.Pin(self.SCL, machine.Pin.OPEN_DRAIN, value=1)
        for _ in range(_CLOCKS):
            if sda.value():
                break
            for level in (0, 1):
                scl.value(level)
                time.sleep_us(_HALF_BIT_US)
        return self._i2c(machine.Pin(self.SCL), machine.Pin(self.SDA))

    def open_wlan(self):
        """Return the radio as a station that never sleeps; its own access point is switched off."""
        network.WLAN(network.AP_IF).active(False)
        wlan = network.WLAN(network.STA_IF)
        wlan.active(True)
        self._stay_awake(wlan)
        return wlan

    def open_battery(self, full_mv):
        """Return what tells the battery's voltage [mV]; `full_mv` fills the ADC's range, 0 means that none is wired."""
        if not full_mv:
            return lambda: 0
        return self._battery(full_mv)

    def open_touch(self):
        """Return what tells the voltage at the touch sensor's pin [mV], on a board that has one."""
        adc = machine.ADC(machine.Pin(self.TOUCH), atten=machine.ADC.ATTN_11DB)
        return lambda: adc.read_uv() // 1000

    def reset_cause(self):
        """Why the unit began anew, as on the wire."""
        cause = machine.reset_cause()
        for index, name in enumerate(_CAUSES):
            if cause == getattr(machine, name, None):
                return index + 1
        return 0

    def full_speed(self):
        """Run the processor at 160 MHz."""
        machine.freq(160_000_000)

    def reset(self):
        """Begin anew."""
        machine.reset()

    def draw(self, size):
        """Return so many random bytes from the hardware; they are random while the radio is on."""
        return os.urandom(size)

    def note(self, text):
        """Keep the end of a text until the power is lost."""
        machine.RTC().memory(text.encode()[-_NOTE:])

    def noted(self):
        """Return the text that was kept."""
        try:
            return machine.RTC().memory().decode()
        except UnicodeError:  # memory that was never written may hold anything
            return ""


class Esp32C3(Board):
    """SDA is GPIO 6, SCL is GPIO 7, the battery is GPIO 3, the touch sensor is GPIO 4."""

    SDA, SCL, BATTERY, TOUCH = 6, 7, 3, 4

    def _i2c(self, scl, sda):
        return machine.I2C(0, scl=scl, sda=sda, freq=_BUS_HZ)

    def _stay_awake(self, wlan):
        wlan.config(pm=wlan.PM_NONE, reconnects=0)  # the one who joins anew is `Station`

    def _battery(self, full_mv):
        adc = machine.ADC(machine.Pin(self.BATTERY), atten=machine.ADC.ATTN_11DB)
        return lambda: adc.read_uv() // 1000 * full_mv // _ADC_FULL_MV

    def open_watchdog(self):
        """Return what resets the unit unless it is fed within 3 s."""
        return machine.WDT(timeout=_WATCHDOG_MS)


class Esp8266(Board):
    """SDA is D2, SCL is D1, the battery is A0, the only pin that measures: there is none for a touch sensor."""

    SDA, SCL = 4, 5

    def _i2c(self, scl, sda):
        return machine.SoftI2C(scl=scl, sda=sda, freq=_BUS_HZ)

    def _stay_awake(self, wlan):
        import esp

        esp.sleep_type(esp.SLEEP_NONE)

    def _battery(self, full_mv):
        adc = machine.ADC(0)
        return lambda: adc.read_u16() * full_mv >> 16

    def open_watchdog(self):
        """Return what resets the unit unless it is fed; after how long, some seconds, the chip decides."""
        return machine.WDT()

    def reset_cause(self):
        """Why the unit began anew; the software watchdog has no name in `machine`."""
        return 3 if machine.reset_cause() == _SOFTWARE_WATCHDOG else super().reset_cause()


def open_socket():
    """Return a UDP socket that does not wait."""
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(address("0.0.0.0", 0))  # noqa: S104 beacons come by the one radio there is
    udp.setblocking(False)
    return udp


def address(host, port):
    """Return an address as the sockets want it."""
    return socket.getaddrinfo(host, port)[0][-1]


def this_board():
    """Return the board this runs on."""
    return Esp8266() if sys.platform == "esp8266" else Esp32C3()
