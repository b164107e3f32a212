"""Force limits of body regions beside the recorded forces: for orientation, not conformity."""

from pretouch.params.pretouch import REGIONS
from pretouch.reporting.contacts import TRANSIENT_S, ContactMeasures
from pretouch.reporting.html import Html, Row, Text, bad, element, joined, number, percent, table

SOURCE = (
    "ISO/TS 15066:2016, table A.2; transient figures are twice the quasi-static ones but for skull and face, where it"
    " has none"
)


def orientation_section(contacts: ContactMeasures) -> Html:
    """The largest forces beside what regions of the body are said to bear."""
    peak, lasting = contacts.peak, contacts.held
    source, here, unsure = "true force, as the simulation knows it", "", ""
    if not contacts.truth_known:
        source, here = "force estimate during detected contacts", " (here of the estimate as it is)"
        unsure = (
            " The estimate has a bandwidth of about 10 Hz and understates the peaks of impacts, and contacts that were"
            " not detected are not in it."
        )
    rows: list[Row] = []
    for name, region in REGIONS.items():
        # the source has no transient figure for skull and face
        transient_n = region.transient * region.force_n if region.transient > 1.0 else None
        transient = peak / transient_n if peak is not None and transient_n else None
        quasi_static = lasting / region.force_n if lasting is not None else None
        rows.append(
            {
                "body region": name.replace("-", " ").capitalize(),
                "transient [N]": number(transient_n, 0),
                "of transient": _marked(transient),
                "quasi-static [N]": number(region.force_n, 0),
                "of quasi-static": _marked(quasi_static),
                "": _bar(max((share for share in (transient, quasi_static) if share is not None), default=None)),
            }
        )
    note = (
        f"For orientation, not conformity. Figures: {SOURCE}. Public copies of such tables disagree. The transient"
        " figure is held against the largest force, the quasi-static one against the largest 20 ms mean later than"
        f" {TRANSIENT_S:g} s into a contact{here}. Which region would be hit, and over what area, is not known here;"
        f" pressures are not looked at.{unsure}"
    )
    later = "none" if lasting is None else f"{lasting:.1f} N"
    sentence = f"Largest {source}: {number(peak, 1)} N; later than {TRANSIENT_S:g} s into a contact: {later}."
    return joined([element("p", sentence), table(rows, note)])


def _marked(share: float | None) -> Text:
    return bad(percent(share)) if share is not None and share > 1 else percent(share)


def _bar(share: float | None) -> Html:
    if share is None:
        return Html("")
    kind = "bar over" if share > 1 else "bar"
    return Html(f'<div class="{kind}"><div style="width:{100 * min(share, 1.0):.0f}%"></div></div>')
