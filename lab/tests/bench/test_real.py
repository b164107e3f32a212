"""`pretouch bench real` on fabricated recordings: adapters, halves, correction, pushes, methods, the count."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.imported_data.files import write_csv
from tests.imported_data.joint_files import Moving

from pretouch import cli
from pretouch.errors import ExperimentError
from pretouch.recording.compare import DetectedContact
from pretouch.text_table import markdown
from pretouch_lab.baselines.window_network import features, learnt
from pretouch_lab.bench import real as bench
from pretouch_lab.bench.players import Alarms, five_sigma
from pretouch_lab.bench.pushes import RealPushes, in_any_direction, pushed, starts, told_least
from pretouch_lab.bench.real import alarms, contacts, delays, halves, parted, tables, trial
from pretouch_lab.bench.real_sets import SETS, RealRun, corrected, files_digest, sets_in, stream_of

FRANKA, LWR4, _, UR10E, _, GLOVE = SETS
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
    assert (len(free.time), free.joints, free.label.max()) == (n - 11, (), 0)
    assert np.isfinite(free.torque).all()
    np.testing.assert_array_equal(wrist.q, motions[1].q)
    np.testing.assert_array_equal(np.flatnonzero(wrist.label == -1), np.arange(60, 70))
    assert (wrist.joints, wrist.label.max()) == ((4, 5, 6), 1)
    cut = LWR4.read([tmp_path / "a.npz"])[1]  # the velocities at the end of a smoothed run are the filter's
    np.testing.assert_array_equal(cut.qd, wrist.qd[wrist.time < wrist.time[-1] - 0.5])
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
    assert (first.joints, first.label.max(), last.label.max()) == ((5,), 1, 0)
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

    def count(given, played, runs):
        judged.append((set(fitted[-1]), set(runs), [int(number) for number in dict.fromkeys(given.run.tolist())]))
        return alarms(given, played, runs)

    monkeypatch.setattr(bench, "corrected", fit)
    monkeypatch.setattr(bench, "alarms", count)
    trial(folder, {"set": "franka_fast", "detector": "five-sigma"}, 0)
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


def flags(time, *spans):
    return np.any([(time >= begin) & (time < end) for begin, end in spans], axis=0)


def test_alarms_and_contacts_are_counted_by_hand(stream):
    """One run of 6 s: uncertain from 1.9 to 2 s, touched from 2 to 2.2 s and, as one with it, from 2.4 to 2.5 s."""
    one = stream.only([1, 0])
    time, label = one.recording.time, np.zeros(len(one.recording.time), np.int64)
    for begin, end, kind in ((1.9, 2.0, -1), (2.0, 2.2, 1), (2.4, 2.5, 1), (4.0, 4.3, 1), (5.0, 5.2, -1)):
        label[np.searchsorted(time, begin) : np.searchsorted(time, end)] = kind
    labelled, cycles = replace(one, label=label), np.arange(0.005, time[-1], 0.01)

    def counted(*spans, links=()):
        named = tuple(DetectedContact(at, np.zeros(3), "", link, np.zeros(3), at, 1.0, 2.0) for at, link in links)
        played = Alarms(cycles, flags(cycles, *spans), np.full(len(cycles), np.nan), named)
        return alarms(labelled, played, [1]) | contacts(labelled, played, [1], [(), (5,)])

    names = ("false_alarms", "contacts", "link_right", "link_named")
    # an alarm in a contact, one in an uncertain contact, one of the other run, and one between runs
    links = ((2.06, "panda_link5"), (4.11, "panda_link4"))
    row = counted((2.05, 2.5), (4.1, 4.3), (5.1, 5.15), (6.2, 6.4), (8.0, 8.5), links=links)
    assert [row[name] for name in names] == [0, 2, 1, 2]
    np.testing.assert_allclose(row["delays_contacts_ms"], [50.0, 100.0], atol=6.0)
    # all time of the run but 1.9 to 2.6, 4 to 4.4 and 5 to 5.3 s, a standing arm included
    assert row["free_s"] == pytest.approx(6.0 - 0.7 - 0.4 - 0.3, abs=0.05)
    # a break of 0.3 s divides no alarm, one of 0.6 s does; one that began earlier finds no contact
    row = counted((0.2, 0.3), (0.6, 0.7), (1.3, 2.1))
    assert [row["false_alarms"], row["delays_contacts_ms"]] == [2, []]
    # one that lasts counts again every two seconds: 1 + 2 of 0 to 5.9 s
    assert counted((0.0, 5.9))["false_alarms"] == 3


def test_a_push_is_found_unless_an_alarm_was_there_before_or_comes_without_it():
    cycles = np.arange(0.005, 10.0, 0.01)
    pushes = RealPushes(np.array([1.0, 3.0, 5.0, 7.0]), np.ones((4, 3)), np.zeros(4, np.bool_))
    nothing = np.full(len(cycles), np.nan)
    untouched = Alarms(cycles, flags(cycles, (5.1, 5.2)), nothing)
    touched = Alarms(cycles, flags(cycles, (1.04, 1.3), (2.95, 3.2), (5.05, 5.2), (7.21, 7.3)), nothing)
    every = delays(pushes, untouched, touched)
    assert every[0] == pytest.approx(0.045, abs=1e-9)
    assert every[1:] == [None, None, None]


def test_a_push_adds_what_the_observer_makes_of_driving_torques_without_its_share(stream, motions, panda_model):
    start = starts(stream, [0, 1], 2.0, seed=3)
    pushes = in_any_direction(start, 20.0, seed=4)
    assert pushes.forearm.tolist() == [k % 2 == 1 for k in range(len(start))]
    np.testing.assert_allclose(np.linalg.norm(pushes.force, axis=1), 20.0)
    # the oracle: forces on the links themselves, taken off the driving torques before the observer
    spoilt, offset = [], 0.0
    for motion in motions:
        driving = motion.driving.copy()
        for begin, force, forearm in zip(pushes.start - offset, pushes.force, pushes.forearm, strict=True):
            for i in np.flatnonzero((motion.time >= begin) & (motion.time < begin + 0.1)):
                kin = panda_model.kinematics(motion.q[i])
                link = panda_model.link_index("panda_link4")
                wrist = kin.position[panda_model.link_index("panda_link5")]
                J = panda_model.jacobian(kin, link, wrist) if forearm else panda_model.ee_jacobian(kin)
                driving[i] -= J[:3].T @ force
        spoilt.append(replace(run_of(motion), torque=driving))
        offset += motion.time[-1] - motion.time[0] + 1.0
    oracle = stream_of(FRANKA, spoilt, panda_model).recording.tau_ext
    np.testing.assert_allclose(pushed(stream, pushes).recording.tau_ext, oracle, atol=1e-3)


def test_pushes_keep_clear_of_contacts_and_of_the_ends_of_runs(stream):
    time, label = stream.recording.time, np.zeros(len(stream.run), np.int64)
    label[(time > 2.0) & (time < 2.5)] = 1
    start = starts(replace(stream, label=label), [0, 2], 0.5, seed=0)
    runs = stream.run[np.searchsorted(time, start)]
    assert set(runs.tolist()) == {0, 2}
    assert not ((start > 1.6) & (start < 2.9)).any()
    for run in (0, 2):
        own = time[stream.run == run]
        assert start[runs == run].min() > own[0] + 0.5
        assert start[runs == run].max() < own[-1] - 0.4


def test_the_direction_told_least_of_gives_less_than_any_other(stream, panda_model):
    at, spread = np.array([3.0]), np.diag([1.0, 2.0, 1.0, 2.0, 0.5, 0.5, 0.1])
    force = told_least(stream, at, np.array([10.0]), spread).force[0]
    q = stream.recording.q[np.searchsorted(stream.recording.time, 3.0)]
    J = panda_model.ee_jacobian(panda_model.kinematics(q))[:3]

    def squares(direction):
        return (J.T @ direction) @ np.linalg.solve(spread, J.T @ direction)

    others = np.random.default_rng(0).normal(size=(200, 3))
    assert np.linalg.norm(force) == pytest.approx(10.0)
    assert all(squares(force) <= squares(10.0 * other / np.linalg.norm(other)) for other in others)


def test_five_sigma_is_five_times_the_rms_of_the_half_to_learn_from(stream):
    tau = np.zeros_like(stream.recording.tau_ext)
    tau[:, 2] = np.where(np.arange(len(tau)) % 2, 0.3, -0.3)  # an rms of 0.3 Nm, the bound is 1.5 Nm
    quiet = replace(stream, recording=replace(stream.recording, tau_ext=tau))
    tau = tau.copy()
    at = np.flatnonzero((stream.recording.time >= 2.0) & (stream.recording.time < 2.1))
    tau[at, 2] = 1.6
    tau[at + 250, 2] = 1.4
    played = five_sigma(quiet)(replace(stream.recording, tau_ext=tau))
    assert played.time[played.alarm][[0, -1]] == pytest.approx([2.005, 2.095], abs=0.01)


def test_the_classifier_finds_pushes_in_noise_and_no_noise_alone(stream):
    random = np.random.default_rng(1)
    noise = random.normal(0.0, 0.3, stream.recording.tau_ext.shape)
    noisy = replace(stream, recording=replace(stream.recording, tau_ext=noise))
    play = learnt(noisy.only([0, 1]))
    other = noisy.only([2, 3])
    start = starts(other, [2, 3], 2.0, seed=5)
    touched = pushed(other, in_any_direction(start, 40.0, seed=6))
    untouched = play(other.recording)
    assert untouched.alarm.mean() < 0.01
    found = [delay for delay in delays(in_any_direction(start, 40.0, 6), untouched, play(touched.recording)) if delay]
    assert len(found) >= 0.8 * len(start)
    assert 0.02 < np.median(found) < 0.1


def test_features_of_a_window_by_hand():
    tau = np.zeros((30, 1))
    tau[20:] = 1.0
    mean, spread, least, most, newest, step, largest, *bands = features(tau)[0]
    assert [mean, spread] == pytest.approx([1 / 3, np.sqrt(2) / 3])
    assert [least, most, newest, step, largest] == pytest.approx([0.0, 1.0, 1.0, 1 / 29, 1.0])
    # Parseval: twice the power of the frequencies, the highest once, is 30 times the sum of squares about the mean
    assert 2.0 * np.exp(bands).sum() == pytest.approx(30.0 * 30.0 * 2.0 / 9.0, rel=0.01)
    tau[3] = np.nan
    assert np.isnan(features(tau)).sum() == 9  # all but the newest


def test_the_table_has_a_row_for_each_set_and_detector_and_one_for_all_sets():
    row = {"detector": "a", "by": "somebody else's program", "free_s": 1800.0, "false_alarms": 1, "stated_n": []}
    for name in ("15n", "30n", "stated"):
        row |= {f"pushes_{name}": 0, f"delays_{name}_ms": []}
    row |= {"contacts": 0, "delays_contacts_ms": [], "pushes_15n": 4, "delays_15n_ms": [20.0, 30.0, 70.0]}
    other = row | {"free_s": 1800.0, "false_alarms": 0, "contacts": 2, "delays_contacts_ms": [9.0], "stated_n": [30.0]}
    (whole,) = tables([{"set": "x"} | row, {"set": "y"} | other, {"set": "y"} | other | {"detector": "b"}])
    # Garwood's bounds of one event: 0.0253 and 5.572, in half an hour
    assert whole.rows[0] == ("x", "a", "30.0", "2 (0-11)", "3/4", "30, 62", "0/0", "-", "-", "-")
    assert whole.rows[1][3:] == ("0 (0-7)", "3/4", "30, 62", "0/0", "30", "-", "1/2")
    assert whole.rows[3] == ("all", "a", "60.0", "1 (0-6)", "6/8", "30, 70", "0/0", "30", "-", "1/2")
    assert len(whole.rows) == 4


def test_the_page_has_the_table_of_the_rows_beside_it():
    results = Path(__file__).parents[3] / "docs/results"
    lines = (results / "data/real-arms.jsonl").read_text(encoding="utf-8").splitlines()
    (whole,) = tables([json.loads(line) for line in lines])
    assert markdown(whole, 2) in (results / "real-recordings.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_whole_command_writes_a_row_for_each_set_and_detector(folder, tmp_path, capsys):
    (folder / "lwr4.npz").write_bytes(b"")
    place, out = tmp_path / "rows.json", str(tmp_path / "out")
    words = ["bench", "real", str(folder), "--detectors", "pretouch,five-sigma", "--json", str(place), "--out", out]
    assert cli.main(words) == 0
    assert "lwr4 is left out, for" in capsys.readouterr().err
    rows = {(row["set"], row["detector"]): row for row in json.loads(place.read_text())["rows"]}
    assert set(rows) == {(s, d) for s in ("franka_fast", "contactInterpretation") for d in ("pretouch", "five-sigma")}
    row = rows["contactInterpretation", "pretouch"]
    assert (len(row["delays_contacts_ms"]), row["contacts"], row["link_right"], row["false_alarms"]) == (3, 3, 3, 0)
    assert 0.0 < np.median(row["delays_contacts_ms"]) < 100.0
    assert row["pushes_stated"] == len(row["stated_n"]) == row["pushes_15n"]
    assert rows["contactInterpretation", "five-sigma"]["pushes_stated"] == 0


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
