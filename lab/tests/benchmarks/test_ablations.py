import pytest

from pretouch.composition import differences
from pretouch.errors import ParameterError
from pretouch.profiles import profile
from pretouch_lab.baselines.detection import Baseline, ablated
from pretouch_lab.benchmarks.ablations import OFF, Ablation, ablations


def differing(a, b):
    """Paths of what differs in two profiles, of another part only its own."""
    paths = {change.partition("=")[0] for change in differences(a, b)} - {"name"}
    return {path for path in paths if not any(path.startswith(f"{other}.") for other in paths)}


def test_every_departure_of_pretouch_from_the_paper_is_switched_off_alone_somewhere():
    assert differing(profile("pretouch"), profile("paper")) - set(OFF) == set()


@pytest.mark.parametrize("switch", OFF)
def test_an_ablation_changes_its_switch_and_nothing_else(switch):
    assert differing(profile(Ablation(switch).profile_text), profile("pretouch")) == {switch}


def test_no_switch_is_in_both_benchmarks_and_only_the_thresholds_are_swept_by_their_base_force():
    of_detection, others = (ablations(of_detection=of) for of in (True, False))
    assert {a.switch for a in of_detection} == {s for s in OFF if s.startswith(("detect", "window."))}
    assert not {a.name for a in of_detection} & {a.name for a in others}
    assert [baseline.name for baseline in ablated() if baseline.sweep == "f_base_n"] == ["without detect"]


def test_an_unknown_switch_is_an_error_and_not_left_out():
    with pytest.raises(ParameterError, match=r"'detect\.lern' is unknown"):
        Baseline("own", "pretouch:detect.lern=no", "scale").profile  # noqa: B018  # it reads the text
