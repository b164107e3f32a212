"""The radio as MicroPython's `network` shows it."""

AP_IF, STA_IF = 1, 0


class State:
    def __init__(self):
        self.active = {AP_IF: True, STA_IF: False}
        self.there = True
        self.asked = None
        self.pm = self.reconnects = None
        self.joined = False


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
        state.joined = state.there and state.asked is not None
        return state.joined

    def connect(self, ssid, password):
        state.asked = (ssid, password)

    def disconnect(self):
        state.asked = None
