"""Force limits of body regions, to hold the recorded forces against: for orientation, not conformity."""

from typing import NamedTuple


class Region(NamedTuple):
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
    Region("Skull and forehead", None, 130.0),
    Region("Face", None, 65.0),
    Region("Chest", 280.0, 140.0),
    Region("Abdomen", 220.0, 110.0),
    Region("Back and shoulders", 420.0, 210.0),
    Region("Upper arms and elbows", 300.0, 150.0),
    Region("Forearms and wrists", 320.0, 160.0),
    Region("Hands and fingers", 280.0, 140.0),
)
"""As `SOURCE` has them; public copies of the table disagree in places."""
