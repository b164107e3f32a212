"""What `pretouch live` does: a simulated arm served as a page."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

from pretouch.errors import HardwareError, ParameterError
from pretouch.extras import LIVE
from pretouch.page.room import LiveSettings, PathName, Room, live_path, settings_for
from pretouch.page.server import ServeOptions, browser_here, check_port
from pretouch.profiles import profile as find_profile
from pretouch.signals import ended
from pretouch.units.udp import EVERYWHERE, HOST

if TYPE_CHECKING:
    from pretouch.cli.commands import Live
    from pretouch.page.real_units import RealUnits
    from pretouch.robot.model import RobotModel
    from pretouch.sensing.skin import Skin


def live(command: "Live") -> None:
    """Serve the page until interrupted."""
    options = ServeOptions(command.host, command.port, browser_here())
    LIVE.need("The page")
    check_port(options)  # before the seconds that the simulation takes to begin
    if command.path not in ("circle", "line"):
        raise ParameterError(f"The path is {command.path!r}: choose circle or line.")
    path, profile = cast(PathName, command.path), find_profile(command.profile)
    settings = LiveSettings(profile=profile, path=path, seed=command.seed)

    from pretouch.cli.warm_up import prepare
    from pretouch.page.live import serve_live
    from pretouch.page.simulation import LiveSimulation
    from pretouch.robot.description import robot_named
    from pretouch.robot.model import RobotModel
    from pretouch.sim.placement import assumptions

    model = RobotModel(robot_named(command.arm))
    settings = settings_for(model, settings)
    believed = skin = _skin(command, model)
    if command.world:
        from pretouch.sim.random_skin import Misplacement, misplaced
        from pretouch.sim.randomisation import drawn, world_set

        world = drawn(world_set(command.world), command.seed, settings.plant)
        settings = replace(settings, plant=world.plant, ranging=world.ranging)
        if not command.keys:
            believed, _ = misplaced(skin, model, Misplacement(world.position_mm, world.orientation_deg), command.seed)
    prepare(profile, lambda: Room(settings, live_path(settings), model, skin).tick())
    with _units(command, skin) as real:
        simulation = LiveSimulation(settings, model, believed, real, skin)
        for sentence in assumptions(model, settings.placement):
            print(sentence, flush=True)
            simulation.notice = f"{simulation.notice} {sentence}".strip()
        if command.opening and not real and not command.record:
            simulation.play_opening()
        if command.record:
            simulation.start_recording(Path(command.record))
        serve_live(simulation, options, ended, partial(print, flush=True))


def _skin(command: "Live", model: "RobotModel") -> "Skin":
    """Return the skin that was asked for, or else the live page's for a Panda or FR3, or the one the arm has."""
    from pretouch.robot.description import is_shipped
    from pretouch.sensing.skin import LIVE_SKIN, skin_for

    arm = model.description
    of_page = LIVE_SKIN.with_name(f"{arm.name}_live.toml") if is_shipped(arm) and not command.keys else ""
    return skin_for(model, command.skin or of_page)


@contextmanager
def _units(command: "Live", skin: "Skin") -> Iterator["RealUnits | None"]:
    """Hear the real units of a skin, if there is a file of their keys."""
    if not command.keys:
        yield None
        return
    if not command.units_host:
        raise HardwareError(f"--units-host is empty: give {HOST}, or {EVERYWHERE} for every address of this machine.")
    from pretouch.page.real_units import RealUnits
    from pretouch.units.keys import load_keys
    from pretouch.units.network_skin import NetworkSkin

    with NetworkSkin(skin.network, load_keys(Path(command.keys)), command.units_host, command.units_port) as source:
        heard = "anywhere" if command.units_host == EVERYWHERE else f"{command.units_host} only"
        print(f"Receiving units from {heard}, at UDP port {source.address[1]}.", flush=True)
        yield RealUnits(source)
