"""What identification keeps where a recording cannot tell: the usual simulated arm."""

from pretouch.sim.plant_params import PlantParams
from pretouch_lab.identification.params import Usual


def usual_of(plant: PlantParams) -> Usual:
    """Return what of a plant identification takes for granted."""
    return Usual(
        plant.friction_f1_nm, plant.friction_f2_s_rad, plant.friction_f3_rad_s, plant.friction_compensated,
        plant.ripple_cycles, plant.torque_noise_hz, plant.observer_gain_1_s, plant.period_s,
    )  # fmt: skip
