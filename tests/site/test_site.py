"""The built site: its pictures, lists and search, and that it asks nobody for anything. Links it checks itself."""

import re
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from tests.needs import skip_for
from tests.page.browser import chromium

import pretouch

ROOT = Path(__file__).parents[2]


class Page(HTMLParser):
    """What a page of the site refers to and can be referred to by, and the numbers that its lists show in order."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.loaded: list[str] = []
        self.pictures: list[tuple[str, str]] = []
        self.numbers: list[int] = []
        self._lists: list[int | None] = []
        self._article = False
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.anchors.add(given.get("id") or "")
        self._article = self._article or tag == "article"
        source = given.get({"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}.get(tag))
        self.loaded += [source] if source else []
        if tag == "img":
            self.pictures.append((given.get("src", ""), given.get("alt") or ""))
        if tag in ("ol", "ul"):
            self._lists.append(int(given.get("start") or 1) if tag == "ol" else None)
        if tag == "li" and self._article and self._lists[-1] is not None:
            self.numbers.append(self._lists[-1])
            self._lists[-1] += 1

    def handle_endtag(self, tag):
        self._article = self._article and tag != "article"
        if tag in ("ol", "ul"):
            self._lists.pop()


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    if find_spec("zensical") is None:
        skip_for("make docs")
    from tools.site.__main__ import build

    out = tmp_path_factory.mktemp("site")
    assert build(out) == 0
    return out / "site"


@pytest.fixture(scope="module")
def pages(site):
    return {path: Page(path) for path in sorted(site.rglob("*.html")) if path.name != "404.html"}


def test_nothing_is_loaded_from_elsewhere(site, pages):
    assert {url for page in pages.values() for url in page.loaded if urlsplit(url).scheme} == set()
    sheets = [path.read_text(encoding="utf-8") for path in site.rglob("*.css")]
    assert sheets
    assert not [sheet for sheet in sheets if "url(http" in sheet or "@import" in sheet]


def test_every_picture_says_in_words_what_it_shows(pages):
    pictures = [picture for page in pages.values() for picture in page.pictures]
    assert len(pictures) >= 15
    assert [src for src, alt in pictures if len(alt) < 10] == []


def test_every_public_name_has_its_place(pages):
    anchors = {anchor for page in pages.values() for anchor in page.anchors}
    names = {f"{place}.{name}" for name, place in pretouch._PLACE.items()}
    assert names - anchors == set()


def test_lists_are_lists(pages):
    """A Markdown list that follows its sentence without a blank line would stay a part of it."""
    broken = [path.name for path in pages if "<p>- " in path.read_text() or "\n- " in _prose(path)]
    assert broken == []


def test_command_lines_are_code(pages):
    assert [path.name for path in pages if re.search(r"<p>\s*(pretouch|make|python) ", _prose(path))] == []


def test_numbered_lists_keep_their_numbers(site, pages):
    """A block that is indented by less than four blanks would end its list, and the next would begin at one."""
    numbered = {}
    for document in sorted((ROOT / "docs").rglob("*.md")):
        text = re.sub(r"^ *```.*?^ *```$", "", document.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
        if numbers := re.findall(r"^ *(\d+)\. ", text, flags=re.MULTILINE):
            page = (site / document.relative_to(ROOT / "docs")).with_suffix(".html")
            numbered[document.name] = [int(number) for number in numbers], pages[page].numbers
    assert len(numbered) > 5
    assert {name: both for name, both in numbered.items() if both[0] != both[1]} == {}


def _prose(path):
    text = path.read_text(encoding="utf-8")
    while (start := text.find("<pre")) >= 0:
        text = text[:start] + text[text.find("</pre>", start) + 6 :]
    return text


def test_the_search_finds_what_is_typed_without_a_server(site):
    with chromium() as visitor:
        page, requests = visitor.page, []
        page.on("request", lambda request: requests.append(request.url))
        page.goto((site / "how-to" / "run.html").as_uri())
        page.keyboard.press("Control+k")
        field = page.get_by_role("combobox", name="Search")
        field.press_sequentially("RangeFinders")
        page.get_by_role("option").filter(has_text="Python: Simulation").first.wait_for()
        assert field.input_value() == "RangeFinders"
        field.press("Enter")
        page.wait_for_url("**/reference/python-simulation.html*#pretouch.sim.range_finder.RangeFinders")
        assert [url for url in requests if urlsplit(url).scheme in ("http", "https")] == []
