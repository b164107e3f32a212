"""The study of touch sensors: where its contacts are, what is made of its rows, and one short trial."""

import numpy as np
import pytest

from pretouch.experiments import tactile, tactile_trial
from pretouch.experiments.cell import Cell, Context, Grid
from pretouch.experiments.tactile_tables import summarise, tables
from pretouch.experiments.tactile_trial import feeling, plan


def contact(force: float, without: float | None, with_touch: float | None, felt: float | None = 0.02) -> dict:
    return {"link": "a", "force_n": force, "duration_s": 0.2, "felt_s": felt, "without": without, "with": with_touch}


def row(contacts: list[dict], place: str = "on patch") -> dict:
    return {"experiment": "tactile", "place": place, "hand": "unseen", "profile": "pretouch", "seed": 1,
            "contacts": contacts}  # fmt: skip


def test_contacts_are_on_patches_and_off_them(paper_skin):
    skin = feeling(paper_skin)
    assert len(skin.touching) == 7
    assert feeling(skin) is skin
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
    assert (cell["contacts"], cell["felt"], cell["missed_without"], cell["missed_with"]) == (2, 2, 1, 0)
    assert (cell["both"], cell["delay_without_ms"], cell["delay_with_ms"]) == (1, 60.0, 40.0)
    whole = next(c for c in found["cells"] if (c["place"], c["force_n"]) == ("on patch", "all"))
    assert (whole["contacts"], whole["delay_without_ms"]) == (3, 40.0)
    contacts, free = tables(found)
    assert len(contacts.rows) == 5
    assert "1 contacts that began" in contacts.note
    assert free.rows[1][:4] == ("with", "0.50", "200", "1")
    assert tables(summarise([])) == []


def test_the_cells_are_its_own(panda_model):
    cells = tactile.cells(Grid(("paper", "pretouch")))
    assert len(cells) == 5
    assert {cell.profile for cell in cells} == {"pretouch"}


@pytest.mark.slow
def test_a_touch_is_told_and_nothing_is_felt_later_for_it(panda_model, paper_skin, monkeypatch):
    monkeypatch.setattr(tactile_trial, "WARM_UP_S", 4.0)
    monkeypatch.setattr(tactile_trial, "COUNT", 3)
    context = Context(panda_model, paper_skin)
    made, _ = tactile.trial(Cell("tactile", "pretouch", {"place": "on patch", "hand": "unseen"}), 1500, context)
    assert len(made["contacts"]) == 3
    for one in made["contacts"]:
        assert one["felt_s"] is not None
        assert one["felt_s"] < 0.06
        assert one["without"] is None or one["with"] <= one["without"] + 1e-9
