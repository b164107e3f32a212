"""The study of touch sensors: where its contacts are, what is made of its rows, and one short trial."""

import numpy as np
import pytest

from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.studies import tactile, tactile_trial
from pretouch_lab.studies.tactile_kinds import INNER, INNER_LINKS
from pretouch_lab.studies.tactile_tables import summarise, tables
from pretouch_lab.studies.tactile_trial import inner_skin, plan, with_touch_sensors


def contact(force: float, without: float | None, with_touch: float | None, heard: float | None = 0.02) -> dict:
    return {
        "link": "a",
        "force_n": force,
        "duration_s": 0.2,
        "heard_s": heard,
        "without": without,
        "with": with_touch,
        "where": {"without": said(0.2, right=False), "with": said(0.01)},
    }


def said(error: float | None, right: bool = True) -> dict:
    """What was said of a contact that is `error` off; None of one that is not detected."""
    detected = error is not None
    return {"detected": detected, "right": detected and right, "error_m": error}


def row(contacts: list[dict], place: str = "on patch") -> dict:
    return {"experiment": "tactile", "place": place, "hand": "unseen", "profile": "pretouch", "seed": 1,
            "contacts": contacts}  # fmt: skip


def test_contacts_are_on_patches_and_off_them(paper_skin):
    skin = with_touch_sensors(paper_skin)
    assert len(skin.touching) == 7
    assert with_touch_sensors(skin) is skin
    at = skin.T_link_sensor[:, :3, 3]
    for place, least, most in (("on patch", 0.0, 0.02), ("beside", 0.04, 1.0)):
        touches = plan(skin, place, 1500, 0.05)
        assert len(touches) == tactile.COUNT
        assert touches == sorted(touches, key=lambda t: t.start)
        for touch in touches:
            near = min(np.linalg.norm(touch.point - at[k]) for k in range(7) if skin.link[k] == touch.link)
            assert least <= near <= most + 1e-9
            assert touch.inwards @ touch.normal < -0.9
    assert plan(skin, "nowhere", 1500, 0.05) == []
    first, again = (plan(skin, "beside", 1501, 0.05)[3] for _ in range(2))
    assert first.point.tolist() == again.point.tolist()


def test_rows_are_counted_by_place_and_force_and_delays_compared_on_the_same_contacts():
    rows = [
        row([contact(5.0, None, 0.05), contact(5.0, 0.06, 0.04), contact(30.0, 0.02, 0.02), contact(5.0, -1.0, 0.1)]),
        row([contact(5.0, None, None, None)], "beside"),
        {"experiment": "tactile", "place": "nowhere", "hand": "none", "profile": "pretouch", "seed": 1,
         "free": {"hours": 0.5, "false_touches": 200, "without": 0, "with": 1}},
    ]  # fmt: skip
    found = summarise(rows)
    assert found["busy"] == 1
    cell = next(c for c in found["cells"] if (c["place"], c["force_n"]) == ("on patch", 5.0))
    assert (cell["contacts"], cell["heard"], cell["missed_without"], cell["missed_with"]) == (2, 2, 1, 0)
    assert (cell["both"], cell["delay_without_ms"], cell["delay_with_ms"]) == (1, 60.0, 40.0)
    whole = next(c for c in found["cells"] if (c["place"], c["force_n"]) == ("on patch", "all"))
    assert (whole["contacts"], whole["delay_without_ms"]) == (3, 40.0)
    contacts, where, free = tables(found)
    assert len(contacts.rows) == 5
    # 15 N and more that last 100 ms: one; all detected, the busy one too: five
    assert where.rows[0] == ("on patch", "unseen", "all", "15 N, 100 ms and more", "1", "1 / 1", "0 / 1", "1",
                             "20.0 / 1.0", "20.0 / 1.0")  # fmt: skip
    assert [row[3:5] for row in where.rows[1:]] == [("all detected", "4"), ("all detected", "1")]
    assert "1 contacts that began" in contacts.note
    assert free.rows[1][:4] == ("with", "0.50", "200", "1")
    assert tables(summarise([])) == []


def test_contacts_of_the_inner_links_are_pushes_on_their_patches(paper_skin):
    skin = inner_skin(paper_skin)
    links = {f"panda_{name}" for name in INNER_LINKS}
    assert len(skin.touching) == len(skin)
    assert {unit.link for unit in skin.units} >= links
    touches = plan(skin, INNER, 1500, 0.05)
    named = [skin.units[int(np.flatnonzero(skin.link == touch.link)[0])].link for touch in touches]
    assert set(named) == links
    assert max(named.count(link) for link in links) < 20
    for touch in touches:
        assert touch.force_n >= 15.0
        assert touch.duration_s >= 0.1
        own = skin.T_link_sensor[skin.link == touch.link, :3, 3]
        assert np.linalg.norm(own - touch.point, axis=1).min() <= 0.02 + 1e-9


def test_places_of_the_inner_links_are_told_link_by_link_and_errors_compared_on_the_same_contacts():
    inner = [contact(30.0, 0.02, 0.02), contact(15.0, 0.02, 0.02) | {"link": "b"}, contact(60.0, None, 0.02)]
    inner[2]["where"]["without"] = said(None)
    found = summarise([row(inner, INNER)])["where"]
    assert [cell["link"] for cell in found] == ["all", "all", "a", "a", "b", "b"]
    whole = found[0]
    assert (whole["contacts"], whole["both"]) == (3, 2)
    assert (whole["without"]["detected"], whole["with"]["detected"], whole["with"]["right"]) == (2, 3, 3)
    assert (whole["without"]["p50_m"], whole["with"]["p90_m"]) == (0.2, 0.01)


def test_the_cells_are_its_own(panda_model):
    cells = tactile.cells(Grid(("paper", "pretouch")))
    assert len(cells) == 7
    assert {cell.profile for cell in cells} == {"pretouch"}


@pytest.mark.slow
def test_a_touch_is_reported_and_nothing_is_detected_later_for_it(panda_model, paper_skin, monkeypatch):
    monkeypatch.setattr(tactile_trial, "WARM_UP_S", 4.0)
    monkeypatch.setattr(tactile_trial, "COUNT", 3)
    context = Context(panda_model, paper_skin)
    made, _ = tactile.trial(Cell("tactile", "pretouch", {"place": "on patch", "hand": "unseen"}), 1500, context)
    assert len(made["contacts"]) == 3
    for one in made["contacts"]:
        assert one["heard_s"] is not None
        assert one["heard_s"] < 0.06
        assert one["without"] is None or one["with"] <= one["without"] + 1e-9
        assert set(one["where"]) == {"without", "with"}
        if one["where"]["with"]["detected"]:
            assert one["where"]["with"]["error_m"] < 0.1
