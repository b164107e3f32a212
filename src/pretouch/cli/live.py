"""What `pretouch live` does: a simulated arm served as a page."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, cast

from pretouch.errors import ParameterError
from pretouch.hardware.address import EVERYWHERE, HOST, PORT
from pretouch.params import profile as find_profile
from pretouch.viewer.server import ServeOptions, check_extra, check_port
from pretouch.viewer.settings import LiveSettings, PathName

if TYPE_CHECKING:
    from pretouch.viewer.real_units import RealUnits


def live(
    profile: str = "paper",
    path: str = "circle",
    seed: int = 0,
    record: str = "",
    host: str = "127.0.0.1",
    port: int = 8080,
    keys: str = "",
    skin: str = "",
    units_host: str = HOST,
    units_port: int = PORT,
) -> None:
    """Serve the page until interrupted.

    Args:
        profile: to begin with, or PROFILE:GROUP.FIELD=VALUE.
        path: 'circle' or 'line'.
        seed: of the arm's errors and all noise.
        record: file to record to from the start, or ''.
        host: address to serve the page at.
        port: port to serve it at.
        keys: file of the keys of real units, to put them on the simulated arm, or ''.
        skin: file that says where on the arm units sit, or '' for the seven of the package.
        units_host: address at which real units are heard.
        units_port: UDP port at which real units are heard.
    """
    options = ServeOptions(host, port)
    check_extra()
    check_port(options)  # before the seconds that the simulation takes to begin
    if path not in ("circle", "line"):
        raise ParameterError(f"The path is {path!r}: choose circle or line.")
    settings = LiveSettings(profile=find_profile(profile), path=cast(PathName, path), seed=seed)

    from pretouch.robot.description import panda
    from pretouch.robot.model import RobotModel
    from pretouch.sensing.skin import load_skin, paper_skin
    from pretouch.viewer.live import serve_live
    from pretouch.viewer.simulation import LiveSimulation

    model = RobotModel(panda())
    mounted = load_skin(skin, model) if skin else paper_skin(model)
    with _units(mounted.ids, keys, units_host, units_port) as real:
        simulation = LiveSimulation(settings, model, mounted, real)
        if record:
            simulation.start_recording(Path(record))
        serve_live(simulation, options)


@contextmanager
def _units(ids: Sequence[str], keys: str, host: str, port: int) -> Iterator["RealUnits | None"]:
    """Hear the real units of a skin, if there is a file of their keys."""
    if not keys:
        yield None
        return
    from pretouch.hardware.keys import load_keys
    from pretouch.hardware.network_skin import NetworkSkin
    from pretouch.viewer.real_units import RealUnits

    with NetworkSkin(ids, load_keys(Path(keys)), host, port) as source:
        heard = "anywhere" if host == EVERYWHERE else f"{host} only"
        print(f"Units are heard from {heard}, at UDP port {source.address[1]}.")
        yield RealUnits(source)
