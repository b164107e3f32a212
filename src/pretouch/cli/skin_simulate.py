"""What `pretouch skin simulate` does: a simulated skin that sends to a receiver in real time."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.arms.simulated.arm import SimulateOptions
from pretouch.arms.simulated.skin import run
from pretouch.cli.skin_keys import keys_file, keys_or_none, with_new
from pretouch.cli.words import words
from pretouch.profiles import profile as find_profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, skin_for
from pretouch.sim.imu import ImuParams
from pretouch.sim.placement import assumptions, placement_for
from pretouch.units.channel import ChannelParams, NetworkParams
from pretouch.units.fleet import FleetParams
from pretouch.units.keys import Keys, save_keys

if TYPE_CHECKING:
    from pretouch.cli.skin_commands import Simulate

_say = partial(print, flush=True)


def simulate_units(command: "Simulate") -> None:
    """Simulate until interrupted, or for the given time."""
    c = command
    up = ChannelParams(
        loss=c.loss, loss_run=c.loss_run, delay_s=c.delay, jitter_s=c.jitter, overtaken=c.overtaken, doubled=c.doubled
    )
    down = ChannelParams(
        loss=c.loss, loss_run=c.loss_run, delay_s=0.15 * c.delay, jitter_s=0.3 * c.jitter, jitter_shape=2.0
    )
    fleet = FleetParams(network=NetworkParams(up, down), imu=ImuParams(), reboot_every_s=c.reboot_every)
    profile = find_profile(c.profile)
    model = RobotModel(robot_named(c.arm))
    skin = skin_for(model, c.skin)
    placement = placement_for(model)
    for sentence in assumptions(model, placement):
        _say(sentence)
    options = SimulateOptions(
        model, skin, keys_for(keys_file(c.keys), skin), c.host, c.port, fleet, placement.path("circle", -1.0),
        profile=profile, hand=c.hand, silenced=frozenset(words(c.silenced)),
        stuck=frozenset(words(c.stuck)), seed=c.seed, duration_s=c.duration,
    )  # fmt: skip
    run(options, lambda: False, _say)


def keys_for(place: Path, skin: Skin) -> Keys:
    """Return the keys of a file, made for the skin's units if it is not there."""
    if place.exists():
        return keys_or_none(place)
    keys = with_new(Keys(), skin.network.ids)
    save_keys(keys, place)
    _say(f"Made keys for {len(keys)} units: {place}")
    return keys
