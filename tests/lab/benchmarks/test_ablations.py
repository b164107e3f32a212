from dataclasses import fields, is_dataclass

import pytest

from pretouch.errors import ParameterError
from pretouch.params import profile
from pretouch.profiles import of_today
from pretouch_lab.benchmarks.ablations import OFF, Ablation, ablations
from pretouch_lab.benchmarks.avoidance.run import Request
from pretouch_lab.benchmarks.detection.contenders import Contender


def differing(a, b, where=""):
    """Paths of what two sets of parameters differ in; of a part that only one has, the path of the part."""
    found = set()
    for f in fields(a):
        path, one, other = f"{where}.{f.name}".lstrip("."), getattr(a, f.name), getattr(b, f.name)
        if type(one) is type(other) and is_dataclass(one):
            found |= differing(one, other, path)
        elif one != other and path != "name":
            found.add(path)
    return found


def test_every_departure_of_pretouch_from_the_paper_is_switched_off_alone_somewhere():
    switched = {path for switch, off in OFF.items() for path in of_today(switch, off)}
    # for how long a path is blocked changes what is said, and nothing that is done
    assert differing(profile("pretouch"), profile("paper")) - switched == {"task.blocked_after_s"}


@pytest.mark.parametrize("switch", OFF)
def test_an_ablation_changes_its_switch_and_nothing_else(switch):
    changes = of_today(switch, OFF[switch])
    assert differing(profile(Ablation(switch).profile_text), profile("pretouch")) == set(changes)


def test_no_switch_is_in_both_benchmarks():
    of_detection, others = (ablations(of_detection=of) for of in (True, False))
    assert {a.switch for a in of_detection} == {s for s in OFF if s.startswith("detection.")}
    assert not {a.name for a in of_detection} & {a.name for a in others}


def test_an_unknown_switch_is_an_error_and_not_left_out():
    with pytest.raises(ParameterError, match=r"'detection\.lern' is unknown"):
        Contender("own", "pretouch:detection.lern=no", "scale").profile  # noqa: B018  # it reads the text
    with pytest.raises(ParameterError, match=r"'reaction\.clamp' is unknown.* Contenders are blind"):
        Request(("pretouch:reaction.clamp=no",))
