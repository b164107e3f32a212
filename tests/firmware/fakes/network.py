"""The radio as MicroPython's `network` shows it. `state` is what tests set and look at."""

import machine

AP_IF, STA_IF = 1, 0


class State:
    def __init__(self):
        self.active = {AP_IF: True, STA_IF: False}
        self.there = True
        """Whether the network answers."""
        self.takes_us = 0
        """Time from an attempt to join until it has."""
        self.asked = []
        """When, for which network and with which password."""
        self.busy = 0
        """So many attempts are refused."""
        self.disconnects = 0
        self.pm = self.reconnects = None
        self.joined_us = None

    @property
    def joined(self):
        return self.there and self.joined_us is not None and machine.state.clock.now_us >= self.joined_us


state = State()


class WLAN:
    PM_NONE = 0

    def __init__(self, interface):
        self.interface = interface

    def active(self, on):
        state.active[self.interface] = on

    def config(self, pm, reconnects):
        state.pm, state.reconnects = pm, reconnects

    def isconnected(self):
        return state.joined

    def connect(self, ssid, password):
        now = machine.state.clock.now_us
        state.asked.append((now, ssid, password))
        if state.busy:
            state.busy -= 1
            raise OSError("Wifi Internal Error")
        state.joined_us = now + state.takes_us

    def disconnect(self):
        state.disconnects += 1
        state.joined_us = None
