"""The study of the units' accelerometers: its cells, contacts by hand, a small run, and its tables."""

from itertools import pairwise

import numpy as np
import pytest

from pretouch.profiles import profile
from pretouch_lab.cell import Grid
from pretouch_lab.studies import imu
from pretouch_lab.studies.impacts.contacts import plan
from pretouch_lab.studies.impacts.judged import judged
from pretouch_lab.studies.impacts.kinds import KINDS, LINKS, pulse


def test_only_profiles_with_the_sequential_test_are_asked():
    changed = "pretouch:detect.cues.imu.gain=10"
    assert [cell.profile for cell in imu.cells(Grid(("paper", changed)))] == [changed] * len(imu.WAYS)
    assert [cell.profile for cell in imu.cells(Grid(("paper", "blind")))] == ["pretouch"] * len(imu.WAYS)


def test_an_impact_by_hand():
    force, duration = pulse(0.2)
    assert force == pytest.approx(0.2 * np.sqrt(75_000.0 * 0.5))
    assert force * duration / 2 == pytest.approx(2 * 0.5 * 0.2), "a hand that bounces off gives twice its momentum"


def test_each_kind_meets_each_link_once():
    touches = plan(1000)
    assert len({(touch.kind, touch.link) for touch in touches}) == len(touches) == len(KINDS) * len(LINKS)
    assert all(b.start > a.end + 2.0 for a, b in pairwise(touches))


@pytest.mark.slow
def test_a_small_run_and_its_tables():
    made = judged(profile("pretouch"), 1003, (0.02, 0.3), 36.0, ("impact 0.5", "push 20"), ("hand", "link5"))
    assert len(made["contacts"]) == 4
    assert made["hours"] == pytest.approx(6.0 / 3600, abs=1e-5)
    assert made["without"]["mean_gain"] == 1.0 < made["with"]["mean_gain"]
    assert sum(contact["with"]["cued"] for contact in made["contacts"]) >= 2, "links with units on or beyond them"
    assert not any(contact["without"]["cued"] for contact in made["contacts"])
    rows = [{"experiment": "imu", "way": way, "profile": "pretouch", "seed": 1003, **made} for way in ("usual", "calm")]
    delays, groups, links, where, free = imu.EXPERIMENT.tables(imu.EXPERIMENT.summarise(rows))
    assert delays.rows[0][:3] == ("usual", "all", "4")
    assert {row[0] for row in groups.rows} == {"forearm", "wrist, hand"}
    assert len(free.rows) == 2
    firm = next(row for row in where.rows if row[:3] == ("usual", "push 20", "15 N, 100 ms and more"))
    assert firm[3] == "2"
    later = next(row for row in where.rows if row[:3] == ("usual", "all", "alarm both ways"))
    both = [c for c in made["contacts"] if "where_later" in c["without"] and "where_later" in c["with"]]
    assert int(later[3]) == len(both) >= 2
    for table in (delays, groups, links, where, free):
        assert all(len(row) == len(table.header) for row in table.rows)
