"""What was learnt of an arm, to a file and back."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pretouch.contact.residual_model import kept, residual_init, resumed
from pretouch.errors import RobotModelError
from pretouch.params import SequentialParams
from pretouch.session.residual_file import Residual, load_residual, save_residual

P = SequentialParams()


def shapes():
    return {name: a.shape for name, a in kept(residual_init(7, P)).items()}


def test_what_was_learnt_comes_back_to_the_bit(tmp_path, panda_model):
    rng = np.random.default_rng(1)
    numbers = kept(residual_init(7, P))
    numbers["weights"] = rng.standard_normal(numbers["weights"].shape)
    save_residual(tmp_path / "free.toml", panda_model, Residual(numbers, "panda at here", 1e9, 1.5e9))
    back = load_residual(tmp_path / "free.toml", panda_model, shapes())
    assert (back.robot, back.since, back.saved) == ("panda at here", 1e9, 1.5e9)
    for name, array in numbers.items():
        assert_array_equal(back.numbers[name], array)
    assert_array_equal(resumed(back.numbers, P).weights, numbers["weights"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("format = 1", "format = 2", "format"),
        ('arm = "panda"', 'arm = "fr3"', "arm"),
        ("joint1", "joint9", "joints"),
        ("shape = [\n    7,\n    12,\n]", "shape = [7, 3]", "weights"),
    ],
)
def test_one_for_another_arm_or_version_is_refused(tmp_path, panda_model, old, new, said):
    path = tmp_path / "free.toml"
    save_residual(path, panda_model, Residual(kept(residual_init(7, P)), "panda at here", 1e9, 1e9))
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(RobotModelError, match=said):
        load_residual(path, panda_model, shapes())


def test_a_file_that_is_not_there_says_so(tmp_path, panda_model):
    with pytest.raises(RobotModelError, match=r"none\.toml"):
        load_residual(tmp_path / "none.toml", panda_model, shapes())
