"""The Panda's model library, as its client loads it, against MuJoCo."""

import ctypes
import platform
import shutil
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
from tests.needs import skip_for

from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_fci.frames import flange_of, pose
from pretouch_fci.model_library import library_answer

_HERE = {"x86_64": 0, "i686": 1, "armv7l": 2, "aarch64": 3}
_GRAVITY = np.array([0.3, -0.2, -9.7])


@pytest.fixture(scope="module", params=[panda, fr3])
def model(request):
    return RobotModel(request.param())


def _request() -> bytes:
    """What a client on a machine such as this asks."""
    if shutil.which("cc") is None or platform.machine() not in _HERE:
        skip_for("apt install gcc libc6-dev")
    return bytes([_HERE[platform.machine()], 0])


Call = Callable[..., FloatArray]


@pytest.fixture(scope="module")
def call(model, tmp_path_factory):
    """Call a function of the library with its arguments, which are followed by where it writes."""
    answer = library_answer(model, _request(), print)
    assert answer[0] == 0
    file = tmp_path_factory.mktemp("library") / "model.so"
    file.write_bytes(answer[1:])
    library = ctypes.CDLL(str(file))

    def called(name: str, size: int, *values: Any) -> FloatArray:
        written = np.full(size, np.nan)
        arrays = [one if isinstance(one, float) else np.ascontiguousarray(one, dtype=float) for one in values]
        passed = [
            ctypes.c_double(one) if isinstance(one, float) else one.ctypes.data_as(ctypes.c_void_p) for one in arrays
        ]
        getattr(library, name)(*passed, written.ctypes.data_as(ctypes.c_void_p))
        return written

    return called


def _turned(rng: np.random.Generator) -> FloatArray:
    quat, matrix = rng.normal(size=4), np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat / np.linalg.norm(quat))
    return matrix.reshape(3, 3)


def test_poses_and_jacobians_of_all_frames(model, call):
    rng, flange = np.random.default_rng(0), flange_of(model)
    frames = [*range(2, 9), flange]
    for q in rng.uniform(model.q_min, model.q_max, (20, 7)):
        kin, F_T_EE = model.kinematics(q), np.eye(4)
        F_T_EE[:3, :3], F_T_EE[:3, 3] = _turned(rng), rng.normal(size=3)
        expected = [pose(kin, link) for link in frames]
        expected.append(expected[-1] @ F_T_EE)
        for number, (link, T) in enumerate(zip([*frames, flange], expected, strict=True), 1):
            given = {1: [], 9: [q, F_T_EE.T]}.get(number, [q])
            posed = call(f"O_T_J{number}", 16, *(given or [q]))
            np.testing.assert_allclose(posed.reshape(4, 4).T, T, atol=1e-12)
            J = model.jacobian(kin, link, T[:3, 3])
            zero, body = (call(f"{name}_J_J{number}", 42, *given).reshape(7, 6).T for name in ("O", "Ji"))
            np.testing.assert_allclose(zero, J, atol=1e-12)
            inward = np.concatenate([T[:3, :3].T @ J[:3], T[:3, :3].T @ J[3:]])
            np.testing.assert_allclose(body, inward, atol=1e-12)


def _loaded(model: RobotModel, mass: float, com: FloatArray, inertia: FloatArray) -> tuple[Any, Any]:
    """An arm that carries that at its flange, and nothing else."""
    spec = mujoco.MjSpec.from_file(str(model.description.mjcf))
    flange = spec.body(model.links[flange_of(model)])
    for child in list(flange.bodies):
        spec.delete(child)
    load = flange.add_body(mass=mass, ipos=com, explicitinertial=True)
    load.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    for joint in spec.joints:
        joint.armature, joint.damping = 0.0, np.zeros_like(joint.damping)
    spec.option.gravity = _GRAVITY
    built = spec.compile()
    return built, mujoco.MjData(built)


def test_mass_matrix_coriolis_and_gravity_with_loads(model, call):
    rng = np.random.default_rng(1)
    for _ in range(20):
        mass, com, R = float(rng.uniform(0.1, 3.0)), rng.uniform(-0.2, 0.2, 3), _turned(rng)
        inertia = R @ np.diag([0.02, 0.03, 0.04] * rng.uniform(0.9, 1.1, 3)) @ R.T
        built, data = _loaded(model, mass, com, inertia)
        q, qd = rng.uniform(model.q_min, model.q_max), rng.uniform(-2, 2, 7)
        M = np.zeros((7, 7))
        data.qpos[:] = q
        mujoco.mj_forward(built, data)
        mujoco.mj_fullM(built, data, M)
        gravity = data.qfrc_bias.copy()
        data.qvel[:] = qd
        mujoco.mj_forward(built, data)
        np.testing.assert_allclose(call("M_NE", 49, q, inertia.T, mass, com).reshape(7, 7), M, atol=1e-11)
        np.testing.assert_allclose(call("g_NE", 7, q, _GRAVITY, mass, com), gravity, atol=1e-10)
        coriolis = call("c_NE", 7, q, qd, inertia.T, mass, com)
        np.testing.assert_allclose(coriolis, data.qfrc_bias - gravity, atol=1e-10)


@pytest.mark.parametrize(
    ("machine", "system", "words"),
    [(0, 1, "Windows on x86_64"), (1, 0, "Linux on i686"), (7, 9, "number 9 on number 7")],
)
def test_another_machine_than_the_servers_gets_none(model, machine, system, words):
    said: list[str] = []
    assert library_answer(model, bytes([machine, system]), said.append) == b"\1"
    here = f"{platform.system()} on {platform.machine()}"
    expected = f"it asks for one for {words}, and here is {here}: start the server on such a machine."
    assert said == [f"The client has no model library: {expected}"]


@pytest.mark.parametrize(
    ("compiler", "words"),
    [
        ("", "there is no C compiler: install one that is found as cc."),
        ("#!/bin/sh\necho cannot find math.h >&2\nexit 1\n", "{} failed (cannot find math.h): install another."),
    ],
)
def test_without_a_compiler_that_works_there_is_none(monkeypatch, tmp_path, compiler, words):
    request, said, place = _request(), [], tmp_path / "cc"
    place.write_text(compiler)
    place.chmod(0o755 if compiler else 0o644)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert library_answer(RobotModel(panda()), request, said.append) == b"\1"
    assert said == [f"The client has no model library: {words.format(place)}"]
