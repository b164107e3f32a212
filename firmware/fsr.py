"""A force-sensing resistor on a pin of the ADC: touched or not, and how hard. Facts: Interlink, FSR 400 series.

Wired as a divider: 3.3 V, the sensor with `BLEED_OHM` across its ends, the pin, `ohm` to ground. Its conductance grows
about in proportion to the force, from less than 0.1 uS untouched; so does that of both together, from that of the
resistor across it. Without this resistor a broken lead would look like a sensor that nobody touches.
"""

from micropython import const

_SUPPLY_MV = const(3300)
_BLEED_OHM = const(33_000)
"""Across the sensor: 30 uS."""
_LINEAR_MV = const(2450)
"""The ADC of an ESP32-C3 tells no more than this."""
_RELEASE = const(70)
"""Part of the smallest force below which a touch is over [%]: more than twice the sensor's hysteresis of 10 %."""


class ForceResistor:
    """Looks at the sensor when asked. Forces in mN, conductances in uS; whole numbers throughout.

    `read_mv()` returns the voltage at the pin [mV]; `ohm` is the resistor to ground; `mn_per_us` the force by
    conductance, found by calibration; `least_mn` the smallest force that is a touch.
    """

    def __init__(self, read_mv, ohm, mn_per_us, least_mn):
        self._read_mv = read_mv
        self._ohm = ohm
        self._mn_per_us = mn_per_us
        self._least = least_mn
        self._bleed_us = 1_000_000 // _BLEED_OHM
        self.touched = False
        self.failed = False
        """Whether the pin shows less than the resistor across the sensor lets through: a lead is broken."""
        self.mv = 0
        """What was read last."""
        self.mn = 0
        """The force then; it ends where the ADC's range does."""

    def look(self):
        """Read the pin; return whether a touch began or ended, or the sensor failed or came back."""
        before = self.touched, self.failed
        self.mv = min(self._read_mv(), _LINEAR_MV)
        conductance = self.mv * 1_000_000 // ((_SUPPLY_MV - self.mv) * self._ohm)
        self.failed = conductance < self._bleed_us // 2
        self.mn = max(0, conductance - self._bleed_us) * self._mn_per_us
        level = self._least * _RELEASE // 100 if self.touched else self._least
        self.touched = not self.failed and self.mn >= level
        return before != (self.touched, self.failed)
