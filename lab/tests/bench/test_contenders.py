import pytest

from pretouch.composition import differences
from pretouch.errors import ParameterError
from pretouch.profiles import profile
from pretouch_lab.bench.contenders import ABLATED, AVOIDANCE, BASE, OFF, Contender, ablated, ablations, profile_text


def differing(a, b):
    """Paths of what differs in two profiles, of another part only its own."""
    paths = {change.partition("=")[0] for change in differences(a, b)} - {"name"}
    return {path for path in paths if not any(path.startswith(f"{other}.") for other in paths)}


def test_every_departure_of_pretouch_from_the_paper_is_switched_off_alone_somewhere():
    assert differing(profile("pretouch"), profile("paper")) - set(OFF) == set()


def test_an_ablation_changes_its_switch_and_nothing_else():
    for switch, off in OFF.items():
        with_it = {"perception.outside"} if switch == "perception.memory" else set()
        assert differing(profile(f"{BASE}:{switch}={off}"), profile("pretouch")) == {switch} | with_it


def test_no_switch_is_in_both_benchmarks_and_only_the_thresholds_are_swept_by_their_base_force():
    of_detection, others = (ablations(of_detection=of) for of in (True, False))
    assert set(of_detection) == {f"without {s}" for s in OFF if s.startswith(("detect", "window."))}
    assert set(of_detection) | set(others) == {f"without {s}" for s in OFF}
    assert not set(of_detection) & set(others)
    assert [contender.name for contender in ablated() if contender.sweep == "f_base_n"] == ["without detect"]


def test_contenders_are_profiles_and_an_unknown_switch_is_an_error_and_not_left_out():
    for name in (*AVOIDANCE, *ABLATED):
        assert profile(profile_text(name))
    assert profile(profile_text("paper-off")).approach is None
    with pytest.raises(ParameterError, match=r"'detect\.lern' is unknown"):
        Contender("own", "pretouch:detect.lern=no", "scale").profile  # noqa: B018  # it reads the text
