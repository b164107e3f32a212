"""Map from the signal of a capacitive electrode to distance, fitted to approaches at known distances.

    python examples/10_map_of_an_electrode.py

The printed table is a sensor type for a skin file. Replace the generated data by your measurements: distances [m], and
signals less their baseline, for the smallest and the largest object that may approach.
"""

import numpy as np
from scipy.optimize import curve_fit

rng, approach = np.random.default_rng(0), np.linspace(0.005, 0.4, 80)
distance = np.concatenate([approach, approach])
signal = np.concatenate([size * 2e-4 / (approach + 0.03) ** 2.5 for size in (0.6, 1.4)]) + rng.normal(0.0, 1e-3, 160)

noise = signal[distance > 0.3].std()
clear = signal > 4.0 * noise
farthest = approach[clear.reshape(2, -1).all(axis=0)].max()
near = clear & (distance <= farthest)


def log_signal(distance, log_gain, offset, power):
    """The map: signal = gain / (distance + offset)^power."""
    return log_gain - power * np.log(distance + offset)


bounds = ([-np.inf, 1e-3, 0.1], [np.inf, 0.3, 10.0])
(log_gain, offset, power), _ = curve_fit(
    log_signal, distance[near], np.log(signal[near]), (-8.0, 0.03, 2.0), bounds=bounds
)
by_map = (np.exp(log_gain) / signal[near]) ** (1.0 / power) - offset
spread = np.sqrt(np.mean((by_map / distance[near] - 1.0) ** 2))
print('[sensor.electrode]\nlike = "capacitive"')
print(f"gain = {np.exp(log_gain):.4g}\noffset_m = {offset:.4g}\npower = {power:.4g}")
print(f"spread_1 = {spread:.4g}\nfarthest_m = {farthest:.3f}")
