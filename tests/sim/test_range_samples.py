"""All that a range finder says, for whoever brings it somewhere."""

import numpy as np
import pytest
from tests.sim.ranging import FORWARD, NO_ERROR, Rig, wall

from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders, RangeSample
from pretouch.sim.scene import Box, SceneSpec
from pretouch.types import RangeStatus


def sent(model, skin, duration: float, *boxes: Box, seed: int = 0, **params: object) -> list[RangeSample]:
    samples: list[RangeSample] = []
    plant = Plant(model, SceneSpec(boxes=boxes), NO_ERROR, model.description.q_ready, seed)
    finders = RangeFinders(plant, skin, RangeFinderParams(**params), seed, samples.append)
    plant.advance(duration)
    assert not np.isfinite(finders.read().stamp).any(), "what is sent elsewhere is not read here"
    return samples


def test_what_is_sent_is_what_would_have_been_read(panda_model, paper_skin, rig):
    at_once = {"latency_s": 0.0, "jitter_s": 1e-6, "dropout": 0.0}
    samples = sent(panda_model, paper_skin, 0.5, wall(0.5), **at_once)
    plant = Plant(panda_model, SceneSpec(boxes=(wall(0.5),)), NO_ERROR, panda_model.description.q_ready, 0)
    read = Rig(plant, RangeFinders(plant, paper_skin, RangeFinderParams(**at_once), 0)).collect(0.5)
    told = sorted((s.unit, s.time, s.distance, s.status) for s in samples)
    seen = sorted(zip(*(read[key].tolist() for key in ("unit", "stamp", "distance", "status")), strict=True))
    assert len(told) >= len(seen) > 150
    assert set(seen) <= set(told)


def test_light_falls_off_with_the_distance_and_never_repeats_itself(panda_model):
    skin = Skin([SensorUnit("front", "panda_hand", FORWARD)], panda_model)
    by_distance = {d: sent(panda_model, skin, 2.0, wall(d)) for d in (0.2, 0.6, 1.2)}
    whole = {
        d: np.mean([s.signal * 256 / s.spads for s in samples if s.status == RangeStatus.OK])
        for d, samples in by_distance.items()
    }
    assert whole[0.2] / whole[0.6] == pytest.approx(9.0, rel=0.1)
    assert whole[0.6] / whole[1.2] == pytest.approx(4.0, rel=0.15)
    for samples in by_distance.values():
        assert all(s.signal + s.ambient < 20.5 and 0 < s.spads <= 256 for s in samples)
        wire = [(round(1e3 * s.distance), round(128 * s.signal), round(128 * s.ambient)) for s in samples]
        assert max(wire.count(one) for one in wire) < 10
        assert all(s.sigma == pytest.approx(0.003 + 0.006 * s.distance, abs=0.003) for s in samples)


def test_without_a_target_only_ambient_light_is_left(panda_model):
    skin = Skin([SensorUnit("front", "panda_hand", FORWARD)], panda_model)
    samples = sent(panda_model, skin, 1.0)
    assert {(s.status, s.distance, s.sigma, s.spads) for s in samples} == {(RangeStatus.SIGNAL, 0.0, 0.0, 256.0)}
    assert max(s.signal for s in samples) < 0.01
    assert np.mean([s.ambient for s in samples]) == pytest.approx(0.3, rel=0.01)
    assert len({round(s.ambient, 4) for s in samples}) > 20
