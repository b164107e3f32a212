"""MuJoCo's functions for compiled code, which are handed addresses: of a model or its data, or an array's first number.

A call from Python costs as much as most of them compute. What MuJoCo cannot go on from, an exhausted memory, ends the
process here, where from Python it raises.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import mujoco
from llvmlite import binding
from numba import types

# the library that the Python package has loaded already; by its names compiled code finds the functions, kept code too
for _file in Path(mujoco.__file__).parent.iterdir():
    if _file.name.startswith("libmujoco"):
        binding.load_library_permanently(str(_file))

_ADDRESS, _NUMBER = types.intp, types.intc


def _declared(name: str, returned: types.Type, *arguments: types.Type) -> Any:
    return types.ExternalFunction(name, returned(*arguments))


def _in_place(name: str, *more: types.Type) -> Callable[..., None]:
    """Declare a function that computes something of a model in its data."""
    return cast(Callable[..., None], _declared(name, types.void, _ADDRESS, _ADDRESS, *more))


mj_step = _in_place("mj_step")
mj_kinematics = _in_place("mj_kinematics")
mj_comPos = _in_place("mj_comPos")
mj_comVel = _in_place("mj_comVel")
mj_crb = _in_place("mj_crb")
mj_fullM = _in_place("mj_fullM", _ADDRESS)
mj_rne = _in_place("mj_rne", _NUMBER, _ADDRESS)
mju_rayGeom: Callable[..., float] = _declared("mju_rayGeom", types.float64, *5 * [_ADDRESS], _NUMBER, _ADDRESS)
