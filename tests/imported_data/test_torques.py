"""Recordings of joint torques: what is read, found, refused and named."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from pretouch.contact.localisation import LocalisationState
from pretouch.errors import ParameterError, RecordingError
from pretouch.imported_data.detect import alike, detect
from pretouch.imported_data.log import Choice
from pretouch.imported_data.reading import open_log
from pretouch.imported_data.results import joint_motion
from pretouch.imported_data.tables import renamed
from pretouch.imported_data.torques import observed, torque_recording
from pretouch.importing.mounting import weights_of
from pretouch.profiles import profile
from pretouch.types import Touched
from tests.imported_data.files import write_csv
from tests.imported_data.joint_files import FRICTION, Moving

PUSHES = ((22.0, 0.4, "panda_link5", (0.0, 25.0, 0.0)), (27.0, 0.4, "panda_hand", (20.0, 0.0, 0.0)))


@pytest.fixture(scope="module")
def pushed(panda_model):
    return Moving(panda_model, 30.0, PUSHES)


@pytest.fixture(scope="module")
def short(panda_model):
    return Moving(panda_model, 6.0)


def read_torques(file, choice):
    return torque_recording(open_log(file, choice).torques(), choice)


def codes(notes):
    return [note.code for note in notes]


def found_in(recording):
    return detect(recording, profile("pretouch"))[0]


@pytest.mark.parametrize("kind", ["external", pytest.param("raw", marks=pytest.mark.slow)])
def test_pushes_are_found_with_their_link_and_force_and_nothing_else(tmp_path, pushed, kind):
    file = getattr(pushed, f"{kind}_csv")(tmp_path / "a.csv")
    recording = read_torques(file, Choice())
    result = found_in(recording)
    assert [c.link for c in result.contacts] == ["panda_link5", "panda_hand"]
    for contact, (start, _, _, force) in zip(result.contacts, PUSHES, strict=True):
        assert start < contact.time_s < start + 0.1
        np.testing.assert_allclose(contact.force_n, force, atol=4.0)
        look, i = contact.circumstances, np.searchsorted(pushed.time, contact.time_s)
        # the push is the residual, and friction, which was learnt, is free motion
        assert np.abs(look.residual_nm - pushed.external[i]).max() < 0.6 * np.abs(pushed.external[i]).max()
        speed = pushed.qd_d[i]
        np.testing.assert_allclose(look.free_motion_nm, -FRICTION * np.tanh(speed / 0.1) - 0.3 * speed, atol=0.5)
        np.testing.assert_allclose(look.speed_rad_s, speed, atol=0.02)
        assert "at rest" not in look.doing
        unusual = np.abs(look.residual_nm) / look.sigma_nm
        assert look.joint == f"panda_joint{unusual.argmax() + 1}"
    assert result.armed_s == pytest.approx(29.0, abs=0.2)
    assert result.contacts_per_hour == pytest.approx(2 * 3600 / result.armed_s)
    assert result.largest_evidence < 1.0
    assert "unwatched" in codes(result.notes)


def test_our_observer_follows_the_external_torques_as_an_observer_of_the_vendors_would(panda_model, pushed):
    n = round(24.0 * 500)
    found = observed(panda_model, pushed.time[:n], pushed.q[:n], pushed.qd_d[:n], pushed.driving[:n], 60.0, 0.0)
    known = np.isfinite(found[:, 0])
    assert 0.08 < pushed.time[:n][known][0] < 0.1
    assert np.abs((found - pushed.tau_ext[:n])[known].mean(axis=0)).max() < 0.02
    assert (found - pushed.tau_ext[:n])[known].std() < 0.1


@pytest.mark.slow
def test_after_a_gap_what_was_learnt_is_kept_and_nothing_is_found_in_it(tmp_path, panda_model, pushed):
    kept = (pushed.time < 12.0) | (pushed.time > 15.0)
    columns = {
        name: values[kept]
        for name, values in pushed.columns(
            ("q*_rad", pushed.q), ("dq*_rad_s", pushed.qd), ("tau*_Nm", pushed.driving)
        ).items()
    }
    recording = read_torques(write_csv(tmp_path / "gap.csv", columns), Choice())
    (gap,) = [note for note in recording.notes if note.code == "gaps"]
    assert (gap.values["count"], gap.values["seconds"]) == (1, pytest.approx(3.0, abs=0.01))
    result = found_in(recording)
    assert ["panda_link5" in result.contacts[0].links, result.contacts[1].link] == [True, "panda_hand"]


def at_rest(recording, q, push):
    """A recording of an arm at rest at positions q (n,), that is pushed with torques (n,) from 4 to 4.4 s."""
    noise = np.random.default_rng(1).normal(0.0, 0.05, recording.q.shape)
    pushed = ((recording.time >= 4.0) & (recording.time < 4.4))[:, None] * push
    still = np.zeros_like(noise)
    return replace(recording, q=still + q, qd=still, qd_commanded=still, tau_ext=noise + pushed)


def test_near_a_singularity_torques_detect_and_a_force_says_that_it_cannot(tmp_path, short):
    recording = read_torques(short.external_csv(tmp_path / "a.csv"), Choice())
    stretched = np.array([0.0, 0.0, -1.5, -0.1, 2.8, 0.16, 0.0])
    deaf = at_rest(recording, stretched, np.array([4.0, 0, 8, 0, 0, 0, 0]))
    result = found_in(deaf)
    assert [4.0 < c.time_s < 4.1 for c in result.contacts] == [True]
    assert result.armed_s == pytest.approx(5.0, abs=0.02)
    assert "deaf" not in codes(result.notes)
    # a contact at rest is not left out of the rate
    assert result.contacts_per_hour == pytest.approx(720.0, rel=0.01)
    with pytest.raises(RecordingError, match=r"not the 1 s of usable force that fill the window of paper"):
        detect(deaf, profile("paper"))


@pytest.mark.parametrize(
    ("speeds", "doing"),
    [
        ((0.0, 0.01, -0.02), "at rest"), ((-0.02, 0.01, 0.03), "setting out"), ((0.5, 0.1, 0.0), "stopping"),
        ((0.2, 0.0, -0.1), "reversing"), ((-0.2, 0.0, -0.3), "cruising"),
    ],
)  # fmt: skip
def test_what_a_joint_was_doing_is_told_by_its_speeds(speeds, doing):
    assert joint_motion(np.array(speeds)) == doing


def test_links_that_explain_the_torques_as_well_are_named_and_no_other(panda_model):
    link = panda_model.surface.link
    hand, fifth, sixth = (link == panda_model.link_index(f"panda_{name}") for name in ("hand", "link5", "link6"))
    ln = np.where(hand, -2.4, np.where(sixth, -2.2, np.where(fifth, 0.0, -9.0)))
    number = np.array([panda_model.link_index("panda_link5")])
    none = Touched(number, np.zeros((1, 3)), np.zeros((1, 3)), np.ones(1), np.ones(1))
    assert alike(LocalisationState(ln, 1.0, 3, 0.0, none), panda_model) == ("panda_link5", "panda_link6")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tau": -1.0}, "are minus the model's at 'panda_joint1', "),
        ({"tau": [-1, -1, -1, 1, -1, -1, -1]}, "at 'panda_joint1', 'panda_joint2', 'panda_joint3', 'panda_joint5', "),
        ({"tau": [1, 1, 1, -1, 1, 1, 1]}, "are minus the model's at 'panda_joint4', but not at 'panda_joint1', "),
        ({"tau": 1000.0}, "in mNm, name the columns tau1_mNm"),
        ({"q": 180 / np.pi}, "as degrees all are within: name the columns q1_deg"),
        ({"dq": 180 / np.pi}, "so they are in degrees: name the columns dq1_deg_s"),
        ({"dq": -1.0}, "with the other sign: reverse them"),
    ],
)
def test_a_wrong_sign_or_unit_is_refused_and_named(tmp_path, short, change, words):
    file = short.raw_csv(tmp_path / "wrong.csv", **change)
    with pytest.raises(RecordingError) as caught:
        read_torques(file, Choice())
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_no_sign_is_taken_that_leaves_the_torques_unexplained(tmp_path, short):
    """All but one are reversed: turned round all together, that one is wrong; of another arm, all are."""
    most = short.raw_csv(tmp_path / "a.csv", tau=[-1, -1, -1, 1, -1, -1, -1])
    with pytest.raises(RecordingError, match="at 'panda_joint4', but not at 'panda_joint1'"):
        read_torques(most, Choice(sign="by-robot"))
    other = short.raw_csv(tmp_path / "b.csv", tau=[0.1, -0.3, 0.2, 0.3, -1, 3, -1])
    assert "unexplained" in codes(read_torques(other, Choice()).notes)
    with pytest.raises(RecordingError, match="--sign by-robot the model of panda leaves"):
        read_torques(other, Choice(sign="by-robot"))


GAINS = np.array([10.0, 11.0, 9.0, 8.0, 5.0, 4.0, 3.0])


@pytest.mark.parametrize(
    ("change", "choice", "words"),
    [
        (lambda tau, weight: tau - weight @ [0, 0, -9.81], {}, "have no gravity in them, so they are external or"),
        (lambda tau, weight: tau / GAINS, {}, "the model's times .*, joint by joint, as motor currents"),
        (lambda tau, weight: tau, {"gravity": (1, 0, 0)}, "points along 0,0,-1 in its base frame, not 1,0,0: give"),
        (
            lambda tau, weight: -tau - weight @ [-9.81, 0, 9.81], {},
            "minus those of an arm whose gravity points along -1,0,0: give the other --sign and --gravity -1,0,0",
        ),
    ],
)  # fmt: skip
def test_torques_of_another_kind_are_refused_and_named(tmp_path, panda_model, short, change, choice, words):
    weight = np.array([weights_of(panda_model, q) for q in short.q])
    columns = short.columns(("q*_rad", short.q), ("dq*_rad_s", short.qd), ("tau*_Nm", change(short.driving, weight)))
    with pytest.raises(RecordingError, match=words):
        read_torques(write_csv(tmp_path / "a.csv", columns), Choice(**choice))


@pytest.mark.parametrize("kg", [2.0, 2.7, 5.0])
def test_a_load_that_nobody_named_is_no_other_mounting_and_no_current(tmp_path, panda_model, short, kg):
    J = np.array([panda_model.ee_jacobian(panda_model.kinematics(q))[:3].T for q in short.q])
    tau = short.driving + kg * J @ [0.0, 0.0, 9.81]
    columns = short.columns(("q*_rad", short.q), ("dq*_rad_s", short.qd), ("tau*_Nm", tau))
    notes = read_torques(write_csv(tmp_path / "a.csv", columns), Choice()).notes
    (load,) = (note for note in notes if note.code == "load")
    assert load.values["kg"] == pytest.approx(kg, abs=0.3)
    assert "mounting" not in codes(notes)


def test_external_torques_of_an_arm_that_is_mounted_otherwise_than_it_thinks_are_refused(tmp_path, panda_model, short):
    weight = np.array([weights_of(panda_model, q) for q in short.q])
    file = external(short, tmp_path / "a.csv", short.tau_ext + weight @ [-9.81, 0.0, -9.81])
    with pytest.raises(RecordingError, match=r"external torques in .* gravity points along 1,0,0 in its base frame"):
        read_torques(file, Choice())


def external(short, file, tau):
    return write_csv(file, short.columns(("q*_rad", short.q), ("dq*_rad_s", short.qd), ("tau_ext*_Nm", tau)))


def test_external_torques_with_gravity_or_in_millinewtons_are_refused(tmp_path, short):
    with pytest.raises(RecordingError, match="gravity is still in them, so name the columns tau1_Nm"):
        read_torques(external(short, tmp_path / "a.csv", short.driving), Choice())
    heavy = external(short, tmp_path / "b.csv", 1000.0 * short.tau_ext)
    with pytest.raises(RecordingError, match="in mNm, name the columns"):
        read_torques(heavy, Choice())


@pytest.mark.slow
def test_currents_need_gains_and_are_then_torques(tmp_path, short):
    columns = short.columns(("q*_rad", short.q), ("dq*_rad_s", short.qd), ("current*_A", short.driving / GAINS))
    file = write_csv(tmp_path / "a.csv", columns)
    with pytest.raises(RecordingError, match="currents of 7 motors and 0 gains: give --gains"):
        read_torques(file, Choice())
    recording = read_torques(file, Choice(gains=tuple(GAINS)))
    same = read_torques(short.raw_csv(tmp_path / "b.csv"), Choice())
    np.testing.assert_allclose(recording.tau_ext, same.tau_ext, atol=1e-9)
    assert "for_currents" in codes(found_in(recording).notes)


def test_a_log_of_libfranka_is_read_as_it_is(tmp_path, short):
    """Its header, spaces included: milliseconds, joints from 0 on, torques by the robot, commands of the same name."""
    columns = {"duration": 1000.0 * short.time, " success rate": np.ones(len(short.time))}
    for name, values in (("q", short.q), ("q_d", short.q), ("dq", short.qd), ("dq_d", short.qd_d),
                         ("tau_J", short.driving), ("tau_ext_hat_filtered", -short.tau_ext)):  # fmt: skip
        columns |= {f"{name}[{j}]" if j == 0 else f" {name}[{j}]": values[:, j] for j in range(7)}
    rows = [",".join([*columns, *[f"dq_d[{j}]" for j in range(7)]])]
    table = np.hstack([np.column_stack(list(columns.values())), np.full((len(short.time), 7), 9.0)])
    rows += [",".join(repr(float(v)) for v in row) for row in table]
    file = tmp_path / "log.csv"
    file.write_text("\n".join(rows))
    recording = read_torques(file, Choice())
    np.testing.assert_allclose(recording.tau_ext, short.tau_ext)
    np.testing.assert_allclose(recording.qd_commanded, short.qd_d)
    np.testing.assert_allclose(recording.time, short.time, atol=1e-8)
    assert recording.by_robot
    assert recording.sources == ("tau_ext_hat_filtered[0]", "q[0]")


def test_columns_of_other_names_are_mapped_one_by_one_or_by_a_pattern(tmp_path, short):
    columns = short.columns(("pos_*", short.q), ("vel.*", short.qd), ("effort[*]", short.tau_ext))
    columns["t"] = columns.pop("time_s")
    file = write_csv(tmp_path / "a.csv", columns)
    text = "t=time_s, pos_*=q*_rad, vel.*=dq*_rad_s, effort[*]=tau_ext*_Nm"
    np.testing.assert_allclose(read_torques(file, Choice(columns=text)).tau_ext, short.tau_ext)


@pytest.mark.parametrize("named", ["q{}_rad", "panda_joint{}_rad"])
def test_joints_may_be_numbered_from_zero_and_positions_named(tmp_path, short, named):
    first = int(named[0] != "q")
    columns = {"time_s": short.time} | {named.format(j + first): short.q[:, j] for j in range(7)}
    columns |= {f"tau_ext{j + first}_Nm": short.tau_ext[:, j] for j in reversed(range(7))}
    recording = read_torques(write_csv(tmp_path / "a.csv", columns), Choice())
    np.testing.assert_array_equal(recording.q, short.q)
    np.testing.assert_array_equal(recording.tau_ext, short.tau_ext)


def test_numbers_of_joints_in_a_pattern_begin_at_one_or_zero():
    assert renamed(Path("a"), ["x_0", "x_1", "y"], "x_*=q*_rad") == ["q1_rad", "q2_rad", "y"]
    assert renamed(Path("a"), ["x_1", "x_2"], "x_*=q*_rad") == ["q1_rad", "q2_rad"]


@pytest.mark.parametrize(
    ("columns", "error", "words"),
    [
        ("tau_J_0", ParameterError, "--columns has 'tau_J_0': write THEIRS=OURS"),
        ("nothing=q1_rad", RecordingError, "has no column 'nothing'"),
        ("no_*=q*_rad", RecordingError, r"has no column 'no_\*'"),
    ],
)
def test_a_mapping_that_is_wrong_is_one_sentence(tmp_path, short, columns, error, words):
    file = short.external_csv(tmp_path / "a.csv")
    with pytest.raises(error, match=words) as caught:
        read_torques(file, Choice(columns=columns))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "choice", "words"),
    [
        (lambda c: c.pop("tau_ext3_Nm"), {}, "has tau_ext of q1, q2, q4, q5, q6, q7, but of q1, q2, q3"),
        (lambda c: [c.pop(name) for name in list(c) if name[0] == "q"], {}, r"but no joint positions \(q1_rad"),
        (lambda c: c.update(q4_ms=c.pop("q4_rad")), {}, "'q4_ms' of .* has the unit 'ms': write q4_rad or q4_deg"),
        (lambda c: c.update(time_s=50 * c["time_s"]), {}, "come at 10 Hz: record at 40 Hz or more"),
        (lambda c: None, {"payload": 1.0}, "which --payload does not change"),
        (lambda c: None, {"gains": (1.0,) * 7}, "--gains is for motor currents"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_one_sentence_with_the_way_out(tmp_path, short, change, choice, words):
    columns = short.columns(
        ("q*_rad", short.q), ("dq*_rad_s", short.qd), ("dq_d*_rad_s", short.qd_d), ("tau_ext*_Nm", short.tau_ext)
    )
    change(columns)
    with pytest.raises(RecordingError, match=words) as caught:
        read_torques(write_csv(tmp_path / "a.csv", columns), Choice(**choice))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) - len(os.fspath(tmp_path)) < 330


def test_a_parquet_file_is_read_with_lists_or_without(tmp_path, short):
    flat = pa.table(dict(short.columns(("q*_rad", short.q), ("dq*_rad_s", short.qd), ("tau_ext*_Nm", short.tau_ext))))
    parquet.write_table(flat, tmp_path / "flat.parquet")
    found = read_torques(tmp_path / "flat.parquet", Choice())
    np.testing.assert_allclose(found.tau_ext, short.tau_ext)
    lists = pa.table({
        "time_s": short.time, "q": list(short.q), "dq": list(short.qd), "tau_ext_hat_filtered": list(-short.tau_ext),
    })  # fmt: skip
    parquet.write_table(lists, tmp_path / "lists.parquet")
    np.testing.assert_allclose(read_torques(tmp_path / "lists.parquet", Choice()).tau_ext, short.tau_ext)


def test_without_velocities_those_of_the_positions_stand_in(tmp_path, short):
    file = write_csv(tmp_path / "a.csv", short.columns(("q*_rad", short.q), ("tau_ext*_Nm", short.tau_ext)))
    with file.open() as text:
        assert "dq1_rad_s" not in next(csv.reader(text))
    recording = read_torques(file, Choice())
    assert np.abs(recording.qd - short.qd_d)[50:-50].max() < 0.01
    assert codes(recording.notes)[-2:] == ["derived_velocities", "no_commands"]
