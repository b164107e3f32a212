"""When a sensor unit is not well: each limit with its unit and its reason (docs/reference/health.md)."""

from dataclasses import dataclass
from typing import Annotated

from pretouch.checks import Check, Checked, Fraction, Positive, PositiveCount


@dataclass(frozen=True)
class HealthParams(Checked):
    """Limits beyond which a unit is said to be faulty, or is warned of."""

    window_s: Positive = 10.0
    """Time over which everything is counted [s]: some 500 samples; as long as a bound on the unit's clock counts."""
    settle_s: Positive = 2.0
    """Time from a unit's first sample on during which its rates and its clock are not judged [s]: about a hundred
    samples and eight beacons. Also how long its clock may be unknown."""
    silent_s: Positive = 0.3
    """Time without a sample from which a unit is silent [s]: the arm holds then (`silent_after_s` of a profile)."""
    rate_hz: Positive = 34.0
    """Fewest readings a second [Hz]: with fewer, one lost reading leaves a sensed point without any for longer than it
    is kept (`persistence_s` of a profile, 0.06 s). Not judged while the window holds a silence or a reboot."""
    rate_fault_hz: Positive = 10.0
    """Fewest readings a second that can be worked with [Hz]: at an age of 0.1 s the arm begins to slow."""
    loss: Fraction = 0.15
    """Largest share of samples lost on their way: the static experiment is shown to bear 10 %, and of 500 samples at
    10 % hardly ever more than 14 % are lost (three standard deviations)."""
    loss_fault: Fraction = 0.3
    """Share lost up to which experiments were made: what comes after it nobody has tried."""
    latency_s: Positive = 0.05
    """Largest median time from a measurement to its arrival [s]: a hand at 1.6 m/s comes 8 cm nearer in it."""
    latency_late_s: Positive = 0.1
    """Largest time of all but one in twenty [s]: at that age of a reading the arm begins to slow. Single late ones are
    used with their age, and no reason for concern."""
    bound_s: Positive = 0.01
    """Largest doubt about the unit's clock [s]: a reading is taken as older by up to twice this. Not judged while the
    window holds a silence or a reboot: a clock that begins anew is not known well yet."""
    sigma_m: Positive = 0.015
    """Largest median standard deviation by the sensor's own estimate [m]: its own limit for status SIGMA."""
    noise_m: Positive = 0.02
    """Largest scatter of successive readings [m]: the data sheet's ranging error in the dark."""
    failed: Fraction = 0.1
    """Largest share of readings whose status says that the sensor failed, rather than that nothing is there."""
    failed_fault: Fraction = 0.5
    """The same share, from which most readings tell nothing."""
    touch_held_s: Positive = 9.0
    """Time for which a unit may say without a break that it is touched [s]: the controller believes it for 10 s."""
    touch_failed: Fraction = 0.1
    """Largest share of touch readings that say the sensor has failed: a lead that works loose."""
    range_late: PositiveCount = 3
    """Samples without a range in time from which the range finder is warned of, within the window."""
    battery_v: Positive = 3.5
    """Least voltage of the battery [V]: a lithium cell has about a tenth of its charge left."""
    battery_fault_v: Positive = 3.3
    """Voltage below which the regulator can no longer hold the 3.3 V of the unit [V]."""
    temperature_low_c: float = -20.0
    """Least temperature [degrees C]: below it the range finder is not specified."""
    temperature_c: Positive = 60.0
    """Largest temperature [degrees C]: a lithium cell must not be discharged above it."""
    temperature_fault_c: Positive = 85.0
    """Temperature above which range finder and IMU are not specified [degrees C]."""
    bus_errors: PositiveCount = 3
    """Failed transfers on the unit's bus from which its wiring is warned of, within the window."""
    imu_rate_hz: Positive = 375.0
    """Fewest IMU samples a second [Hz]: nine tenths of the 416 Hz that the firmware sets; an impact lasts
    milliseconds."""
    imu_loss: Fraction = 0.02
    """Largest share of IMU samples lost beyond those in lost datagrams: its FIFO ran over."""
    reboots: PositiveCount = 1
    """Reboots within the window that are warned of; each is a second of silence."""
    firmware: Annotated[int, Check(low=0, high=0xFFFF)] = 0x0001
    """Oldest firmware that is served: major version * 256 + minor version."""
