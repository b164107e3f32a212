"""A page and somebody at it: serves it in a thread, and drives a headless Chromium."""

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from matplotlib.image import imread
from tests.needs import skip_for
from tests.ports import free_port

from pretouch.page.scene import CAMERA_AT, CAMERA_FOV, CAMERA_FROM
from pretouch.page.server import ServeOptions, url_of
from pretouch.types import FloatArray

PATIENCE_S = 120
"""Time a page in software WebGL on a busy machine is given [s]."""
SCREENSHOTS = Path("build/screenshots")


Serve = Callable[[ServeOptions, Callable[[], bool], Callable[[str], None]], None]
"""Serves a page until it is told to stop, and says where it is."""


@contextmanager
def serving(serve: Serve) -> Iterator[SimpleNamespace]:
    """A page served in a thread until the context ends, and its `options`."""
    options, errors = ServeOptions(port=free_port()), list[BaseException]()
    ready, end = threading.Event(), threading.Event()

    def run() -> None:
        try:
            serve(options, end.is_set, lambda line: ready.set())
        except BaseException as error:  # told to the test that waits
            errors.append(error)
        finally:
            ready.set()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert ready.wait(PATIENCE_S)
    try:
        if not errors:
            yield SimpleNamespace(options=options)
    finally:
        end.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
        if errors:
            raise errors[0]


@contextmanager
def chromium(width: int = 1280, height: int = 800) -> Iterator["Visitor"]:
    """A person's browser; the test is skipped where there is none."""
    if find_spec("playwright") is None:
        skip_for("make browser")
    from playwright import sync_api

    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        skip_for("apt-get install chromium")
    software = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox", *software])
        try:
            yield Visitor(browser.new_page(viewport={"width": width, "height": height}, has_touch=True))
        finally:
            browser.close()


class Visitor:
    """Somebody at a page."""

    def __init__(self, page) -> None:
        self.page = page
        self.received = 0
        """Bytes the page was sent."""
        page.set_default_timeout(1000 * PATIENCE_S)
        page.on("websocket", lambda socket: socket.on("framereceived", self._count))

    def _count(self, data: str | bytes) -> None:
        self.received += len(data)

    def open(self, served: SimpleNamespace) -> None:
        """Wait until the page shows the arm's mode and its scene, and close viser's warning."""
        self.page.goto(url_of(served.options))
        self.page.wait_for_selector("#mode")
        self.page.wait_for_selector("canvas")
        self.page.locator("text=Software WebGL").locator("xpath=../..").locator("button").first.click()

    def text(self, name: str) -> str:
        """One of word, reason, mode, rates, warning, notice."""
        return str(self.page.locator(f"#{name}").inner_text())

    def box(self, selector: str) -> dict[str, float]:
        """Where the first thing of a selector is, and its size [px]."""
        box = self.page.locator(selector).first.bounding_box()
        assert box is not None
        return {key: float(value) for key, value in box.items()}

    def wait_for(self, name: str, contained: str) -> None:
        """Wait until a line of the status holds some words; fails with all that the status says instead."""
        try:
            self.page.wait_for_function(
                "([name, words]) => (document.getElementById(name)?.textContent ?? '').includes(words)",
                arg=[name, contained],
            )
        except Exception as error:
            text = "name => document.getElementById(name)?.textContent"
            lines = {line: self.page.evaluate(text, line) for line in ("word", "reason", "mode", "rates", "notice")}
            raise AssertionError(f"{name} never said {contained!r}: {lines}") from error

    def wait_until(self, true: Callable[[], bool]) -> None:
        """Wait until something holds outside of the page."""
        deadline = time.monotonic() + PATIENCE_S
        while not true():
            assert time.monotonic() < deadline, "it has not come to pass"
            self.page.wait_for_timeout(100)

    def press(self, label: str) -> None:
        self.page.get_by_role("button", name=label, exact=True).click()

    def tab(self, name: str) -> None:
        self.page.get_by_text(name, exact=True).first.click()

    def field(self, label: str):
        """Where something is typed, or the field of a slider."""
        row = self.page.locator("label", has_text=label).first.locator("xpath=../../..")
        return row.locator("input:not([type=hidden])").last

    def type(self, label: str, value: float) -> None:
        """Have a number in a field at once."""
        field = self.field(label)
        field.fill(f"{value:g}")
        field.press("Enter")
        field.blur()

    def choose(self, label: str, option: str) -> None:
        self.page.get_by_label(label, exact=True).first.click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def drag(self, start: FloatArray, end: FloatArray, finger: bool = False) -> None:
        """Drag with the mouse, or a finger, from where a point (3,) [m] is seen to where another one is."""
        box = self.page.locator("canvas").first.bounding_box()
        seen = np.array([seen_at(point, box) for point in (start, end)])
        way = [tuple(seen[0] + share * (seen[1] - seen[0])) for share in np.linspace(0.0, 1.0, 11)]
        if finger:
            session = self.page.context.new_cdp_session(self.page)
            for kind, at in (("touchStart", way[0]), *(("touchMove", at) for at in way[1:]), ("touchEnd", ())):
                points = [{"x": at[0], "y": at[1]}] if at else []
                session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
            return
        mouse = self.page.mouse
        mouse.move(*way[0])
        mouse.move(way[0][0] + 1, way[0][1])
        mouse.down()
        for at in way[1:]:
            mouse.move(*at)
        mouse.up()

    def colour_at(self, point: FloatArray) -> FloatArray:
        """Red, green and blue (3,), from 0 to 255, of the pixel where a point (3,) [m] is seen."""
        x, y = seen_at(point, self.page.locator("canvas").first.bounding_box())
        shot = self.page.screenshot(clip={"x": x, "y": y, "width": 1, "height": 1})
        return 255.0 * np.asarray(imread(BytesIO(shot)))[0, 0, :3]

    def wait_for_skin(self, point: FloatArray) -> None:
        """Wait until something of the colour of skin is seen where a point (3,) [m] is."""

        def there() -> bool:
            red, _, blue = self.colour_at(point)
            return bool(red > blue + 20.0)

        self.wait_until(there)

    def keep(self, name: str, folder: Path) -> Path:
        """Keep a picture for a person to look at, in a folder of the test's and where they are gathered."""
        place = folder / f"{name}.png"
        self.page.screenshot(path=place)
        SCREENSHOTS.mkdir(parents=True, exist_ok=True)
        shutil.copy(place, SCREENSHOTS / place.name)
        return place


def seen_at(point: FloatArray, box: dict[str, float]) -> tuple[float, float]:
    """Pixel where a point is seen by the camera the page begins with: a pinhole, z up."""
    forward = np.subtract(CAMERA_AT, CAMERA_FROM)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right)
    seen = np.array([right, -np.cross(right, forward), forward]) @ np.subtract(point, CAMERA_FROM)
    scale = box["height"] / 2 / np.tan(CAMERA_FOV / 2)
    return (
        box["x"] + box["width"] / 2 + scale * seen[0] / seen[2],
        box["y"] + box["height"] / 2 + scale * seen[1] / seen[2],
    )
