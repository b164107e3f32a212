"""Force limits of body regions beside the recorded forces: for orientation, not conformity."""

from typing import NamedTuple

from pretouch.reporting.contacts import TRANSIENT_S, ContactMeasures
from pretouch.reporting.html import Html, Text, bad, element, joined, number, percent, table


class BodyRegion(NamedTuple):
    """What a region of the body is said to bear."""

    name: str
    transient: float | None
    """Force of a contact of less than 0.5 s [N], None if the source has none."""
    quasi_static: float
    """Force of a contact that lasts [N]."""


SOURCE = (
    "ISO/TS 15066:2016, table A.2; transient figures are twice the quasi-static ones but for skull and face, where it"
    " has none"
)
REGIONS = (
    BodyRegion("Skull and forehead", None, 130.0),
    BodyRegion("Face", None, 65.0),
    BodyRegion("Chest", 280.0, 140.0),
    BodyRegion("Abdomen", 220.0, 110.0),
    BodyRegion("Back and shoulders", 420.0, 210.0),
    BodyRegion("Upper arms and elbows", 300.0, 150.0),
    BodyRegion("Forearms and wrists", 320.0, 160.0),
    BodyRegion("Hands and fingers", 280.0, 140.0),
)
"""As `SOURCE` has them; public copies of the table disagree in places."""


def orientation_section(contacts: ContactMeasures) -> Html:
    """The largest forces beside what regions of the body are said to bear."""
    peak, lasting = contacts.peak, contacts.held
    source, here, unsure = (
        ("true force, as the simulation knows it", "", "")
        if contacts.truth_known
        else (
            "force estimate during detected contacts",
            " (here of the estimate as it is)",
            " The estimate has a bandwidth of about 10 Hz and understates the peaks of impacts, and contacts that were"
            " not detected are not in it.",
        )
    )
    later = "none" if lasting is None else f"{lasting:.1f} N"

    def shares(region: BodyRegion) -> tuple[float | None, float | None]:
        transient = peak / region.transient if peak is not None and region.transient else None
        return transient, lasting / region.quasi_static if lasting is not None else None

    columns = [
        ("body region", lambda region: region.name),
        ("transient [N]", lambda region: number(region.transient, 0)),
        ("of it", lambda region: _marked(shares(region)[0])),
        ("quasi-static [N]", lambda region: number(region.quasi_static, 0)),
        ("of it", lambda region: _marked(shares(region)[1])),
        ("", lambda region: _bar(max((share for share in shares(region) if share is not None), default=None))),
    ]
    note = (
        f"For orientation, not conformity. Figures: {SOURCE}. Public copies of such tables disagree. The transient"
        " figure is held against the largest force, the quasi-static one against the largest 20 ms mean later than"
        f" {TRANSIENT_S:g} s into a contact{here}. Which region would be hit, and over what area, is not known here;"
        f" pressures are not looked at.{unsure}"
    )
    largest = f"Largest {source}: {number(peak, 1)} N; later than {TRANSIENT_S:g} s into a contact: {later}."
    return joined([element("p", largest), table(columns, REGIONS, note)])


def _marked(share: float | None) -> Text:
    return bad(percent(share)) if share is not None and share > 1 else percent(share)


def _bar(share: float | None) -> Html:
    if share is None:
        return Html("")
    kind = "bar over" if share > 1 else "bar"
    return Html(f'<div class="{kind}"><div style="width:{100 * min(share, 1.0):.0f}%"></div></div>')
