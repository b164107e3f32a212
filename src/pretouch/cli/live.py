"""The command `pretouch live`: a simulated arm served as a page."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

from pretouch.cli.options import Numbers, OptionalFile, ProfileText, UnitOptions
from pretouch.cli.warm_up import prepare
from pretouch.extras import LIVE
from pretouch.page.real_units import RealUnits
from pretouch.page.room import LiveSettings, Room, live_path, settings_for
from pretouch.page.server import ServeOptions, browser_here, check_port
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import profile as find_profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, skin_for
from pretouch.signals import ended
from pretouch.sim.paper_scenes import assumptions
from pretouch.units import EVERYWHERE
from pretouch.units.keys import load_keys
from pretouch.units.skin import NetworkSkin


@dataclass(frozen=True)
class Live:
    """Watch the simulated arm in a browser and touch it: a page with the arm, your hand, plots and all parameters."""

    profile: ProfileText = "pretouch"
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm, to which the room is scaled."""
    gravity: Numbers = ()
    """Direction of gravity in the arm's base frame, as of `pretouch run`."""
    path: Literal["circle", "line"] = "circle"
    """The paper's path that the arm follows."""
    seed: int = 0
    """Seed of the simulated arm: each has different errors and noise."""
    record: OptionalFile = None
    """Recording to write from the start; the page can also start and stop recordings."""
    host: str = "127.0.0.1"
    """Address to serve the page at. Beyond this machine, whoever has the printed address can move the simulated arm."""
    port: int = 8080
    """Port to serve the page at."""
    skin: OptionalFile = None
    """Skin file; by default sixteen units with zones, of an imported arm the skin in its folder."""
    opening: bool = True
    """True if three arms and a scripted hand begin, until somebody drags or clicks; never with --keys or --record."""
    units: UnitOptions = field(default_factory=UnitOptions)

    def run(self) -> None:
        """Serve the page until interrupted."""
        options = ServeOptions(self.host, self.port, browser_here())
        LIVE.need("The page")
        from pretouch.page.live import serve_live  # needs the extra

        check_port(options)  # before the seconds that the simulation takes to begin
        profile = find_profile(self.profile)
        settings = LiveSettings(profile=profile, path=self.path, seed=self.seed)

        model = RobotModel(robot_named(self.arm, self.gravity))
        settings = settings_for(model, settings)
        skin = skin_for(model, self.skin)
        prepare(profile)
        Room(settings, live_path(settings), model, skin).tick()  # compiles what simulates
        with _units(self, skin) as real:
            simulation = LiveSimulation(settings, model, skin, real)
            for sentence in assumptions(model, settings.placement):
                print(sentence, flush=True)
                simulation.notice = f"{simulation.notice} {sentence}".strip()
            if self.opening and not real and not self.record:
                simulation.play_opening()
            if self.record:
                simulation.start_recording(self.record)
            serve_live(simulation, options, ended, partial(print, flush=True))


@contextmanager
def _units(command: Live, skin: Skin) -> Iterator[RealUnits | None]:
    """Hear the real units of a skin, if there is a file of their keys."""
    units = command.units
    if not units.keys:
        yield None
        return
    with NetworkSkin(skin.network, load_keys(units.keys), units.units_host, units.units_port) as source:
        senders = "anywhere" if units.units_host == EVERYWHERE else f"{units.units_host} only"
        print(f"Receiving units from {senders}, at UDP port {source.address[1]}.", flush=True)
        yield RealUnits(source)
