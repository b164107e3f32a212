from dataclasses import asdict
from pathlib import Path

import pytest

from pretouch.errors import ParameterError
from pretouch.params import profile
from pretouch_lab.benchmarks.ablations import OFF, Ablation, ablations
from pretouch_lab.benchmarks.avoidance.run import AvoidanceBench
from pretouch_lab.benchmarks.detection.baselines import Baseline


def differing(a, b):
    """Fields of two profiles that differ, as GROUP.FIELD."""
    one, other = asdict(a), asdict(b)
    return {f"{g}.{f}" for g in one if g != "name" for f in one[g] if one[g][f] != other[g][f]}


def test_every_departure_of_pretouch_from_the_paper_is_switched_off_alone_somewhere():
    assert differing(profile("pretouch"), profile("paper")) <= set(OFF)


@pytest.mark.parametrize("switch", OFF)
def test_an_ablation_changes_its_switch_and_nothing_else(switch):
    assert differing(profile(Ablation(switch).profile_text), profile("pretouch")) == {switch}


def test_no_switch_is_in_both_benchmarks():
    of_detection, others = (ablations(of_detection=of) for of in (True, False))
    assert {a.switch for a in of_detection} == {s for s in OFF if s.startswith("detection.")}
    assert not {a.name for a in of_detection} & {a.name for a in others}


def test_an_unknown_switch_is_an_error_and_not_left_out():
    with pytest.raises(ParameterError, match=r"'detection\.lern' is unknown"):
        Baseline("own", "pretouch:detection.lern=no", "scale").profile  # noqa: B018  # it reads the text
    with pytest.raises(ParameterError, match=r"'reaction\.clamp' is unknown.* Baselines are blind"):
        AvoidanceBench(Path(), baselines=("pretouch:reaction.clamp=no",))
