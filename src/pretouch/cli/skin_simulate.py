"""The command `pretouch skin simulate`: a simulated skin that sends to a receiver in real time."""

from contextlib import closing
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

from pretouch.arms.simulated.skin import run
from pretouch.cli.options import OptionalFile, Words
from pretouch.errors import ParameterError
from pretouch.profiles import profile as find_profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import skin_for
from pretouch.session.terminal import say
from pretouch.sim.imu import ImuParams
from pretouch.sim.paper_scenes import assumptions, placement_for
from pretouch.units import HOST, PORT
from pretouch.units.fleet import ChannelParams, Fleet, FleetParams, NetworkParams
from pretouch.units.keys import Keys, load_keys, save_keys


@dataclass(frozen=True)
class Simulate:
    """Simulate a skin that sends what real units send: an arm on its path, and a hand that comes and goes."""

    keys: Path
    """File of the units' keys, created if it is missing. `pretouch skin monitor` needs the same file."""
    skin: OptionalFile = None
    """Skin file; by default the seven units that come with the package, of profile pretouch the sixteen."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    host: str = HOST
    """Name or address of the receiver."""
    port: int = PORT
    """UDP port of the receiver."""
    channel: ChannelParams = field(default_factory=ChannelParams)
    """Loss and delay of datagrams to the receiver; on the way back as many are lost, and the delay is shorter."""
    reboot_every: float = 0.0
    """Time between two reboots of each unit [s]; 0: none."""
    silenced: Words = ()
    """Names of units that send nothing, separated by commas."""
    stuck: Words = ()
    """Names of units whose range finder repeats its first reading, separated by commas."""
    hand: bool = True
    """True if a person's hand comes and goes."""
    profile: str = "paper"
    """Profile of the arm's controller, or PROFILE:GROUP.FIELD=VALUE."""
    seed: int = 0
    """Decides all that is random."""
    duration: float = 0.0
    """Time to simulate [s]; 0: until Ctrl-C."""

    def run(self) -> None:
        """Simulate until interrupted, or for the given time."""
        if self.seed < 0 or not 0.0 <= self.duration < inf:
            raise ParameterError(f"--seed is {self.seed}, --duration {self.duration:g} s: give 0 or more of both.")
        up = self.channel
        down = ChannelParams(up.loss, 0.15 * up.delay_s, 0.3 * up.jitter_s, jitter_shape=2.0)
        params = FleetParams(network=NetworkParams(up, down), imu=ImuParams(), reboot_every_s=self.reboot_every)
        model, profile, end = RobotModel(robot_named(self.arm)), find_profile(self.profile), self.duration or inf
        skin = skin_for(model, self.skin, paper=profile.sight.memory is None)
        placement = placement_for(model)
        for sentence in assumptions(model, placement):
            say(sentence)
        keys = load_keys(self.keys) if self.keys.exists() else Keys().with_new(skin.network.ids)
        if not self.keys.exists():
            save_keys(keys, self.keys)
            say(f"Made keys for {len(keys)} units: {self.keys}")
        with closing(Fleet(skin.network, keys, params, self.seed, (self.host, self.port))) as fleet:
            fleet.set_faults(self.silenced, self.stuck)
            run(model, skin, fleet, placement.path("circle", -1.0), profile, self.hand, lambda now: now >= end, say)
