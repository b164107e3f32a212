"""`pretouch bench real` on fabricated recordings: adapters, halves, correction, the count."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.imported_data.files import write_csv
from tests.imported_data.joint_files import Moving

from pretouch import cli
from pretouch.errors import ExperimentError
from pretouch.recording.compare import DetectedContact
from pretouch_lab.bench import real as bench
from pretouch_lab.bench.real import halves, parted, tally, total, trial
from pretouch_lab.bench.real_sets import SETS, RealRun, corrected, files_digest, sets_in, stream_of

FRANKA, UR10E, GLOVE = SETS[0], SETS[3], SETS[4]
PUSH = (3.0, 0.5, "panda_link5", (0.0, 30.0, 0.0))


@pytest.fixture(scope="module")
def motions(panda_model):
    """Four free motions with a load of 1.5 kg, unlike each other in their noise alone."""
    return [Moving(panda_model, 6.0, rate=250.0, payload=1.5, seed=seed) for seed in range(4)]


def arrays(motions, **more):
    """What a file of arrays holds of motions."""
    kinds = {"t": "time", "q": "q", "dq": "qd", "tau": "driving"}
    joined = {name: np.concatenate([getattr(m, kind) for m in motions]) for name, kind in kinds.items()}
    return joined | {"run": np.repeat(np.arange(len(motions)), [len(m.time) for m in motions])} | more


def run_of(motion):
    return RealRun(motion.time, motion.q, motion.qd, motion.driving, np.zeros(len(motion.time), np.int64), ())


@pytest.fixture(scope="module")
def stream(motions, panda_model):
    return stream_of(FRANKA, [run_of(motion) for motion in motions], panda_model)


def test_a_file_of_arrays_is_read_run_by_run_without_what_the_logger_missed(tmp_path, motions):
    n = len(motions[0].time)
    ok, label = np.ones(2 * n, np.bool_), np.zeros(2 * n, np.int8)
    ok[10:20], label[n + 50 : n + 60], label[n + 60 : n + 70] = False, 1, -1
    given = arrays(motions[:2], ok=ok, label=label, run_name=np.array(["free", "collision_wrist"]))
    given["tau"][30] = np.nan
    np.savez(tmp_path / "a.npz", **given)
    free, wrist = UR10E.read([tmp_path / "a.npz"])
    assert (len(free.time), free.joints, free.touched) == (n - 11, (), False)
    assert np.isfinite(free.torque).all()
    np.testing.assert_array_equal(wrist.q, motions[1].q)
    np.testing.assert_array_equal(np.flatnonzero(wrist.label == -1), np.arange(60, 70))
    assert (wrist.joints, wrist.touched) == ((4, 5, 6), True)
    (tmp_path / "c.npz").write_bytes(b"no archive")
    with pytest.raises(ExperimentError, match=r"c\.npz is no file of NumPy arrays .*: get it again"):
        UR10E.read([tmp_path / "c.npz"])
    np.savez(tmp_path / "b.npz", t=given["t"], q=given["q"])
    with pytest.raises(ExperimentError, match=r"b\.npz has no dq, run, tau: get it again"):
        UR10E.read([tmp_path / "b.npz"])


def glove_csv(file, motion, label):
    """Write a motion as contactInterpretation has it, with columns that are not read."""
    columns = {"index": np.arange(len(motion.time)), "time": motion.time}
    kinds = ("tau_J", motion.driving), ("tau_ext", -motion.external), ("q", motion.q), ("dq", motion.qd)
    columns |= {f"{kind}{j}": values[:, j] for kind, values in kinds for j in range(7)}
    columns["label"] = label
    file.parent.mkdir(parents=True, exist_ok=True)
    write_csv(file, columns)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, panda_model, motions):
    """A set of free motion, and one of contacts on link 5 whose last run nobody touches."""
    sets = tmp_path_factory.mktemp("sets")
    np.savez(sets / "franka_fast.npz", **arrays(motions))
    for seed, pushes in enumerate(((PUSH,), (PUSH,), (PUSH,), ()), 1):
        motion = Moving(panda_model, 6.0, pushes, rate=200.0, seed=seed)
        label = len(pushes) * ((motion.time >= PUSH[0]) & (motion.time < PUSH[0] + PUSH[1]))
        glove_csv(sets / "contactInterpretation" / "link5" / f"e{seed}.csv", motion, label)
    return sets


def test_a_table_of_the_glove_gives_measured_torques_its_label_and_its_folders_link(folder):
    first, *_, last = GLOVE.read(GLOVE.files(folder))
    assert (first.joints, first.touched, last.touched) == ((5,), True, False)
    np.testing.assert_allclose(first.time[first.label == 1][[0, -1]], [3.0, 3.495], atol=1e-9)
    # gravity is in the second joint of measured torques, and in no external one
    assert np.abs(first.torque[:, 1]).max() > 10.0
    file = folder.parent / "link1" / "x.csv"
    file.parent.mkdir()
    file.write_text("index,time,q0\n1,0.0,0.1\n")
    with pytest.raises(ExperimentError, match="has no column q1: get it again"):
        GLOVE.read([file])


def test_no_run_is_judged_by_what_was_learnt_from_it_each_is_judged_once_and_a_single_one_is_cut(motions):
    for count in range(2, 8):
        assert all(learn and not set(learn) & set(judge) for learn, judge in halves(count))
        assert sorted(run for _, judge in halves(count) for run in judge) == list(range(count))
    first, second = parted([run_of(motions[0])])
    np.testing.assert_array_equal([*first.time, *second.time], motions[0].time)


def test_what_is_learnt_does_not_depend_on_the_runs_that_are_judged(stream):
    judge, other = [1, 3], np.isin(stream.run, [1, 3])
    spoilt = stream.recording.tau_ext.copy()
    spoilt[other] += np.random.default_rng(0).normal(0.0, 30.0, spoilt[other].shape)
    changed = replace(stream, recording=replace(stream.recording, tau_ext=spoilt))
    fitted = [corrected(s, [0, 2]).only([0, 2]).recording.tau_ext for s in (stream, changed)]
    np.testing.assert_array_equal(*fitted)
    own = [corrected(s, judge).only(judge).recording.tau_ext for s in (stream, changed)]
    assert not np.array_equal(own[0], own[1], equal_nan=True)


def test_each_detector_is_shown_corrections_of_the_other_half_alone(folder, monkeypatch):
    fitted, judged = [], []

    def fit(given, runs):
        fitted.append(set(runs))
        return corrected(given, runs)

    def count(given, alarms, course, runs, joints):
        judged.append((set(fitted[-1]), set(runs), [int(number) for number in dict.fromkeys(given.run.tolist())]))
        return tally(given, alarms, course, runs, joints)

    monkeypatch.setattr(bench, "corrected", fit)
    monkeypatch.setattr(bench, "tally", count)
    trial(folder, {"set": "franka_fast", "detector": "fixed"}, 0)
    assert len(judged) == 2
    for learn, runs, order in judged:
        assert not learn & runs
        assert set(order[:2]) == learn  # a detector that learns has heard the other half before
        assert set(order[2:]) == runs


def test_load_and_friction_of_one_half_explain_the_other(stream):
    free = np.isfinite(stream.recording.tau_ext).all(axis=1) & np.isin(stream.run, [1, 3])
    before, after = (s.recording.tau_ext[free] for s in (stream, corrected(stream, [0, 2])))
    # 1.5 kg at half a metre and more, and friction of 0.5 Nm and more
    assert np.sqrt((before**2).mean(axis=0)).max() > 5.0
    # what is left is mostly noise: 5 mrad/s of velocity by 60 1/s and 1.5 kg m^2 is 0.45 Nm
    assert np.sqrt((after**2).mean(axis=0)).max() < 0.6
    assert np.abs(after.mean(axis=0)).max() < 0.1


def alarm(time, end, link="panda_link5"):
    return DetectedContact(time, np.zeros(3), "", link or None, np.zeros(3), end, 1.0, 2.0)


def test_alarms_are_counted_by_hand(stream):
    """One run of 6 s: not sure from 1.9 to 2 s, touched from 2 to 2.2 s and, as one with it, from 2.4 to 2.5 s."""
    one = stream.only([1, 0])
    time, label = one.recording.time, np.zeros(len(one.recording.time), np.int64)
    for begin, end, kind in ((1.9, 2.0, -1), (2.0, 2.2, 1), (2.4, 2.5, 1), (4.0, 4.3, 1), (5.0, 5.2, -1)):
        label[np.searchsorted(time, begin) : np.searchsorted(time, end)] = kind
    labelled = replace(one, label=label)
    cycles = np.concatenate([np.arange(0.005, 6.0, 0.01), np.arange(7.005, time[-1], 0.01)])
    armed = cycles > 1.0

    def counted(*alarms):
        return tally(labelled, alarms, SimpleNamespace(time=cycles, judged=armed), [1], [(), (5,)])

    names = ("found", "contacts", "busy", "false_alarms", "link_right", "link_said")

    def numbers(count):
        return tuple(count[name] for name in names)

    nothing = counted()
    assert numbers(nothing) == (0, 2, 0, 0, 0, 0)
    # armed from 1 s to the end at 6 s, less 1.9 to 2.6, 4 to 4.4 and 5 to 5.3 s
    assert nothing["motion_s"] == pytest.approx(5.0 - 0.7 - 0.4 - 0.3, abs=0.05)
    # one of a contact that is not sure, and one of a run that is not judged
    both = counted(alarm(2.05, 2.5), alarm(4.1, 4.3, "panda_link4"), alarm(5.1, 5.1), alarm(7.5, 8.0))
    assert numbers(both) == (2, 2, 0, 0, 1, 2)
    np.testing.assert_allclose(both["delays_s"], [0.05, 0.1], atol=0.005)
    early = counted(alarm(1.5, 2.1), alarm(4.39, 4.4, ""))
    assert numbers(early) == (1, 1, 1, 1, 0, 0)
    assert counted(alarm(0.5, 0.6))["false_alarms"] == 0  # not armed
    row = total([both, early])
    assert numbers(row) == (3, 3, 1, 1, 1, 2)
    assert row["median_delay_ms"] == pytest.approx(100.0, abs=5.0)
    assert row["per_hour"] == pytest.approx(3600.0 / (2 * 3.6), rel=0.02)
    row = total([nothing | {"motion_s": 1800.0, "false_alarms": 1}])
    assert (row["per_hour"], row["link_right"], row["median_delay_ms"]) == (2.0, None, None)
    assert row["per_hour_high"] == pytest.approx(11.143, abs=1e-3)
    assert total([nothing | {"motion_s": 0.0}])["per_hour"] is None


@pytest.mark.slow
def test_the_whole_command_writes_a_row_for_each_set_table_and_detector(folder, tmp_path, capsys):
    (folder / "lwr4.npz").write_bytes(b"")
    place, out = tmp_path / "rows.json", str(tmp_path / "out")
    words = ["bench", "real", str(folder), "--detectors", "pretouch,fixed", "--json", str(place), "--out", out]
    assert cli.main(words) == 0
    numbers, kinds = json.loads(place.read_text()), ("free", "contacts")
    assert "lwr4 is left out, for" in capsys.readouterr().err
    rows = {(row["set"], kind, row["detector"]): row[kind] for row in numbers["rows"] for kind in kinds if kind in row}
    sets = [("franka_fast", "free"), ("contactInterpretation", "free"), ("contactInterpretation", "contacts")]
    assert set(rows) == {(*each, detector) for each in sets for detector in ("pretouch", "fixed")}
    row = rows["contactInterpretation", "contacts", "pretouch"]
    assert (row["found"], row["contacts"], row["link_right"], row["false_alarms"]) == (3, 3, 3, 0)
    assert 0.0 < row["median_delay_ms"] < 100.0
    assert rows["franka_fast", "free", "pretouch"]["contacts"] == 0


def test_a_folder_without_a_set_says_what_was_looked_for_and_where_it_comes_from(tmp_path, capsys):
    for given in (tmp_path, tmp_path / "nowhere"):
        assert cli.main(["bench", "real", str(given)]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert f"{given} has no set that can be played" in said
        assert all(each.place in said and each.source in said for each in SETS)
    (tmp_path / "ur10e_contact.npz").write_bytes(b"")
    with pytest.raises(ExperimentError, match=r"ur10e_contact is left out, for .*arms/ur10e is missing"):
        sets_in(tmp_path)
    (tmp_path / "arms" / "ur10e").mkdir(parents=True)
    assert sets_in(tmp_path) == ([UR10E], [])
    file = tmp_path / "franka_fast.npz"
    digests = [file.write_bytes(content) and files_digest([FRANKA], tmp_path) for content in (b"1", b"2", b"1")]
    assert (len(set(digests)), digests[0]) == (2, digests[2]), "a file that was replaced is noticed"
    assert cli.main(["bench", "real", str(tmp_path), "--detectors", "nobody"]) == 2
    assert "nobody" in capsys.readouterr().err


def test_streams_keep_their_runs_apart_and_currents_are_read_as_such(stream, motions, panda_model):
    some = stream.only([2, 0])
    change = np.flatnonzero(np.diff(some.run))
    assert some.run[change].tolist() == [2]
    assert np.diff(some.recording.time)[change] == pytest.approx(1.0)
    assert np.isnan(some.recording.tau_ext[change + 1]).all()
    assert stream_of(replace(UR10E, arm="panda"), [run_of(motions[0])], panda_model).recording.kind == "current"
