"""Other people's programs: how it is told whether one ran."""

import shlex
import sys
import tomllib
from pathlib import Path

import pytest
from fci.programs import forces, report
from fci.programs.playing import Played, Program, programs_of, run

KNOWN = tomllib.loads((Path(report.__file__).parent / "programs.toml").read_text(encoding="utf-8"))


def played(code: str, limit: float = 10.0, **rest: object) -> Played:
    return run(Program("it", f"{shlex.quote(sys.executable)} -c {shlex.quote(code)}", **rest), {}, limit)


def test_one_that_says_what_it_should_and_complains_of_nothing_runs():
    one = played("input('Press Enter'); print('Finished motion')", says="Finished motion")
    assert (one.verdict, one.why) == ("runs", "")


@pytest.mark.parametrize(
    ("code", "verdict", "why"),
    [
        ("print('something else')", "fails", "ended with 0: something else"),
        ("", "fails", "ended with 0: it said nothing"),
        ("print('done'); raise SystemExit(3)", "fails", "ended with 3: done"),
        # examples catch what is thrown, print it, and end with 0
        ("print('done'); print('libfranka: Move aborted!')", "fails", "libfranka: Move aborted!"),
        ("print('libfranka: Move command rejected!'); print('done')", "refused", "libfranka: Move command rejected!"),
        ("print('Press Enter...Error occurred: none'); print('done')", "fails", "Error occurred: none"),
        ("raise ConnectionRefusedError('Connection refused')", "refused", "ConnectionRefusedError: Connection refused"),
    ],
)
def test_any_other_does_not_and_its_first_complaint_says_why(code, verdict, why):
    one = played(code, says="done")
    assert (one.verdict, one.why) == (verdict, why)


def test_one_that_is_meant_to_go_on_is_ended_by_ctrl_c_and_must_have_gone_on_till_then():
    goes_on = "import time; print('reads', flush=True); time.sleep(60)"
    assert played(goes_on, says="reads", ctrl_c=0.5).verdict == "runs"
    assert played("print('reads')", says="reads", ctrl_c=5.0).verdict == "fails"


def test_one_that_hangs_is_killed():
    assert played("import time; print('done', flush=True); time.sleep(60)", limit=0.5, says="done").verdict == (
        "does not end"
    )


def test_the_list_names_each_program_once_and_for_a_robot_that_a_server_has():
    for one in KNOWN["set"]:
        programs = list(programs_of(one))
        assert len({program.name for program in programs}) == len(programs)
        assert all(program.name in program.command for program in programs)
        assert any(one["robot"] in server["robots"] for server in KNOWN["server"].values())


def test_the_table_has_a_column_for_each_server_that_was_tried(tmp_path):
    title = KNOWN["set"][0]["title"]
    ran, failed = {"verdict": "runs", "why": ""}, {"verdict": "fails", "why": "x"}
    found = {title: {"echo": {"pretouch": ran, "franka-sim": failed}}}
    counts, failures = report.tables_of(KNOWN, found)
    assert counts.header == ("set", "pretouch", "franka-sim")
    assert counts.rows == ((title, "1 of 1", "0 of 1"),)
    assert failures.rows == (("echo", title.partition(",")[0], "runs", "fails"),)
    document = tmp_path / "programs.md"
    document.write_text(f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n")
    report.into(document, KNOWN, found)
    text = document.read_text()
    assert (text[:7], text[-7:]) == ("before\n", "\nafter\n")
    assert f"| echo | {title.partition(',')[0]} | runs | fails |" in text
    assert "old" not in text


def test_forces_tells_its_words_and_refuses_a_simulator_that_it_does_not_have(capsys, monkeypatch):
    for words, status, text in (("--help", 0, "NAME=PYTHON"), (f"gazebo={sys.executable}", 2, "pretouch=PYTHON")):
        monkeypatch.setattr(sys, "argv", ["forces", words])
        with pytest.raises(SystemExit) as end:
            forces.main()
        assert end.value.code == status
        assert text in "".join(capsys.readouterr())
