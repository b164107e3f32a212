"""What a count of the LSM6DS3, the inertial sensor of a unit, stands for at each of its full scales."""

import numpy as np

STANDARD_GRAVITY = 9.80665
"""[m/s^2]; the data sheet gives accelerations in its thousandths."""
ACCELERATION_LSB = {g: 1e-3 * mg * STANDARD_GRAVITY for g, mg in ((2, 0.061), (4, 0.122), (8, 0.244), (16, 0.488))}
"""One count of the accelerometer [m/s^2] by its full scale [g] (data sheet, LA_So)."""
ANGULAR_RATE_LSB = {
    dps: float(np.deg2rad(1e-3 * mdps))
    for dps, mdps in ((125, 4.375), (245, 8.75), (500, 17.5), (1000, 35.0), (2000, 70.0))
}
"""One count of the gyroscope [rad/s] by its full scale [degrees/s] (data sheet, G_So)."""
LARGEST_COUNT = 2**15 - 1
"""Where counts end, whatever the full scale is called."""


def counts_of(scale: int) -> tuple[float, float]:
    """Return one count of accelerometer [m/s^2] and gyroscope [rad/s] by the scales of a datagram.

    Scales are those of docs/reference/wire.md; others are a ValueError.
    """
    rates = list(ANGULAR_RATE_LSB.values())
    code = scale >> 4 & 7
    if code >= len(rates):
        raise ValueError(f"the gyroscope's full scale has the code {code}: there are 0 to {len(rates) - 1}")
    return list(ACCELERATION_LSB.values())[scale & 3], rates[code]
