"""The animation of README: the opening of the live page, drawn from a recording.

    python -m tools.picture record build/opening.mcap
    python -m tools.picture draw build/opening.mcap docs/images/opening.webp

It needs the packages of the page's tests, `make browser` and a Chromium, and a few minutes. The browser draws one frame
after the other, so a slow machine draws the same animation.
"""

import io
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from PIL import Image
from tests.page.browser import Visitor, chromium
from tests.ports import free_port

import pretouch as pt
from pretouch.page.panel import PANEL_PX
from pretouch.page.replay import ReplayPage
from pretouch.page.room import LiveSettings
from pretouch.page.server import ServeOptions, served
from pretouch.page.simulation import LiveSimulation
from pretouch.recording.reader import Recorded

FROM_S, TO_S, FRAMES_PER_S = 2.2, 10.2, 10
"""Start and end of the animation in the simulation's time [s], from the first motion of the hand, and its rate."""
WIDTH_PX, HEIGHT_PX = 720, 450
_EDGE_PX = 20
"""Width of the panel's shadow to its left [px]."""
_FOV, _LOOK_AT = 0.62, (0.25, 0.22, 0.31)
_STYLE = """
    div#caption {position: fixed !important; left: 385px; top: 14px !important; width: 320px}
    div#caption {background: none !important}
    #caption #word {font-size: 40px !important} #caption #reason {font-size: 21px !important; color: #202124}
    #caption #rates {display: none}
"""
_CAPTION = """() => {
    const caption = document.getElementById('caption') ?? document.body.appendChild(document.createElement('div'));
    caption.id = 'caption';
    caption.replaceChildren(document.getElementById('status').cloneNode(true));
}"""
"""Script that shows word and sentence large over the scene: in the panel they are too small for an animation."""


def record(place: Path, until: float = TO_S) -> None:
    """Record the opening, up to a time in the simulation [s]."""
    model = pt.RobotModel(pt.panda())
    settings = LiveSettings(profile=pt.profile("pretouch"))
    simulation = LiveSimulation(settings, model, pt.skin_for(model))
    simulation.play_opening()
    simulation.start_recording(place)
    simulation.advance(until)
    simulation.stop_recording()


def drawn(recorded: Recorded, times: Sequence[float]) -> Iterator[Image.Image]:
    """Draw a recording at increasing times on the clock of its steps [s]."""
    options = ServeOptions(port=free_port())
    with served(options, "Pretouch") as server, chromium(WIDTH_PX + PANEL_PX + _EDGE_PX, HEIGHT_PX) as visitor:
        page = ReplayPage(server, recorded)
        server.initial_camera.fov, server.initial_camera.look_at = _FOV, _LOOK_AT
        page.draw(-1.0)
        visitor.open(SimpleNamespace(options=options))
        visitor.page.add_style_tag(content=_STYLE)
        for number, time in enumerate(times):
            page.player.seek(time - recorded.stamps()[0])
            # the first call sends the arm's colours, the second shows them
            for now in (2 * number, 2 * number + 1):
                page.draw(float(now))
                visitor.wait_for("rates", f"{page.player.time:.2f} of ")
                shot = _settled(visitor)
            yield Image.open(io.BytesIO(shot)).convert("RGB")


def _settled(visitor: Visitor) -> bytes:
    """Return a screenshot of the page after its last change."""
    visitor.page.evaluate(_CAPTION)
    clip, before, shot = {"x": 0, "y": 0, "width": WIDTH_PX, "height": HEIGHT_PX}, None, b""
    while shot != before:
        before, shot = shot, visitor.page.screenshot(clip=clip)
    return shot


def write(frames: Sequence[Image.Image], place: Path) -> None:
    """Write frames as an animation in real time that repeats for ever."""
    more = {"duration": round(1000 / FRAMES_PER_S), "loop": 0, "quality": 75, "method": 6}
    frames[0].save(place, save_all=True, append_images=frames[1:], **more)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["record", place]:
            record(Path(place))
        case ["draw", source, place]:
            instants = np.arange(FROM_S, TO_S - 1e-9, 1 / FRAMES_PER_S)
            write(list(drawn(pt.open_recording(Path(source)), instants)), Path(place))
        case _:
            sys.exit(__doc__)
