"""What `pretouch skin simulate` does: a simulated skin that sends to a receiver in real time."""

from functools import partial
from pathlib import Path

from pretouch.cli.arms import arm_model
from pretouch.cli.skin_commands import Simulate
from pretouch.cli.skin_keys import keys_file, keys_or_none, with_new
from pretouch.cli.words import words
from pretouch.hardware.keys import Keys, save_keys
from pretouch.params import profile as find_profile
from pretouch.sensing.skin import Skin, load_skin, paper_skin
from pretouch.serving.fleet import FleetParams
from pretouch.serving.network import NetworkParams, WayParams
from pretouch.serving.simulate import SimulateOptions, run
from pretouch.sim.imu import ImuParams


def simulate_units(command: Simulate) -> None:
    """Simulate until interrupted, or for the given time."""
    c = command
    up = WayParams(
        loss=c.loss, loss_run=c.loss_run, delay_s=c.delay, jitter_s=c.jitter, overtaken=c.overtaken, doubled=c.doubled
    )
    down = WayParams(
        loss=c.loss, loss_run=c.loss_run, delay_s=0.15 * c.delay, jitter_s=0.3 * c.jitter, jitter_shape=2.0
    )
    fleet = FleetParams(network=NetworkParams(up, down), imu=ImuParams(), reboot_every_s=c.reboot_every)
    profile = find_profile(c.profile)
    model = arm_model(c.arm)
    skin = load_skin(Path(c.skin), model) if c.skin else paper_skin(model)
    options = SimulateOptions(
        model, skin, _keys(keys_file(c.keys), skin), c.host, c.port, fleet, profile=profile, hand=c.hand,
        silenced=frozenset(words(c.silenced)), stuck=frozenset(words(c.stuck)), seed=c.seed, duration_s=c.duration,
    )  # fmt: skip
    run(options, lambda: False, partial(print, flush=True))


def _keys(place: Path, skin: Skin) -> Keys:
    """Return the keys of a file, made for the skin's units if it is not there."""
    if place.exists():
        return keys_or_none(place)
    keys = with_new(Keys(), skin.ids)
    save_keys(keys, place)
    print(f"Made keys for {len(keys)} units: {place}", flush=True)
    return keys
