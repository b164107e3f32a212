"""Random skins: a unit a link, on its surface."""

import numpy as np

from pretouch.sim.random_skin import HEIGHT, random_skin

LINKS = ("link2", "link3", "link4", "link5", "link6", "link7", "hand")


def height(model, link: int, point: np.ndarray) -> float:
    """Distance of a point in a link's frame to its capsules [m], by a search along their axes."""
    own = model.capsules.of_links(np.array([link]))
    axis = own.a[:, None] + np.linspace(0, 1, 2001)[None, :, None] * (own.b - own.a)[:, None]
    return float((np.linalg.norm(axis - point, axis=2).min(axis=1) - own.radius).min())


def test_there_is_a_unit_on_each_link_from_the_second_to_the_hand(panda_model, fr3_model):
    for model, prefix in ((panda_model, "panda_"), (fr3_model, "fr3_")):
        assert [unit.link for unit in random_skin(model, 0).units] == [prefix + name for name in LINKS]


def test_units_sit_on_the_surface_and_look_away_from_it(panda_model):
    for seed in range(20):
        skin = random_skin(panda_model, seed)
        for link, pose in zip(skin.link, skin.T_link_sensor, strict=True):
            above = height(panda_model, link, pose[:3, 3])
            assert 0.0 <= above <= HEIGHT + 1e-6
            assert height(panda_model, link, pose[:3, 3] + 0.3 * pose[:3, 2]) > above


def test_a_seed_always_makes_the_same_skin_and_another_a_different_one(panda_model):
    first, again, other = (random_skin(panda_model, seed).T_link_sensor for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert np.abs(first - other).max() > 0.05
