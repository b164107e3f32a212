"""What `pretouch live` does: a simulated arm served as a page."""

from pathlib import Path
from typing import cast

from pretouch.errors import ParameterError
from pretouch.params import profile as find_profile
from pretouch.viewer.server import ServeOptions, check_extra, check_port
from pretouch.viewer.settings import LiveSettings, PathName


def live(
    profile: str = "paper",
    path: str = "circle",
    seed: int = 0,
    record: str = "",
    host: str = "127.0.0.1",
    port: int = 8080,
) -> None:
    """Serve the page until interrupted.

    Args:
        profile: to begin with, or PROFILE:GROUP.FIELD=VALUE.
        path: 'circle' or 'line'.
        seed: of the arm's errors and all noise.
        record: file to record to from the start, or ''.
        host: address to serve the page at.
        port: port to serve it at.
    """
    options = ServeOptions(host, port)
    check_extra()
    check_port(options)  # before the seconds that the simulation takes to begin
    if path not in ("circle", "line"):
        raise ParameterError(f"The path is {path!r}: choose circle or line.")
    settings = LiveSettings(profile=find_profile(profile), path=cast(PathName, path), seed=seed)

    from pretouch.viewer.live import serve_live
    from pretouch.viewer.simulation import LiveSimulation

    simulation = LiveSimulation(settings)
    if record:
        simulation.start_recording(Path(record))
    serve_live(simulation, options)
