import json

import pytest
from lab.tests.identification.made import Made, free_motion
from tests.imported_data.files import write_csv

from pretouch import cli
from pretouch_lab.domain_randomisation import drawn, world_set


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    samples = free_motion(Made(), seconds=40.0)
    kinds = {"q{}_rad": samples.q, "qd{}_rad_s": samples.qd, "tau_ext{}_Nm": samples.tau}
    columns = {name.format(j + 1): values[:, j] for name, values in kinds.items() for j in range(7)}
    place = tmp_path_factory.mktemp("free") / "free.csv"
    return write_csv(place, {"time_s": samples.stamp} | columns)


@pytest.mark.slow
def test_identify_writes_arm_numbers_and_figure(table, tmp_path, capsys):
    out, figure, numbers = (tmp_path / name for name in ("arm.toml", "residual.png", "numbers.json"))
    given = ["identify", str(table), "--out", str(out), "--figure", str(figure), "--json", str(numbers)]
    assert cli.main(given) == 0
    said = capsys.readouterr().out
    assert "on the robot (--sign)" in said
    assert "offset [Nm]" in said
    assert figure.stat().st_size > 10_000
    found = json.loads(numbers.read_text())
    assert found["observer_gain_1_s"][0] == pytest.approx(45.0, rel=0.03)
    assert found["contact_spans_s"] == []
    plant = drawn(world_set(str(out)), 1001).plant
    assert plant.observer_gain_1_s == pytest.approx(found["observer_gain_1_s"][0], rel=1e-4)


def test_without_velocities_no_torque_noise_is_told_and_the_other_sign_turns_offsets_round(table, tmp_path, capsys):
    lines = [line.split(",") for line in table.read_text().splitlines()]
    place, numbers = tmp_path / "still.csv", tmp_path / "numbers.json"
    place.write_text("\n".join(",".join(line[:8] + line[15:]) for line in lines) + "\n")
    assert cli.main(["identify", str(place), "--sign", "by-robot", "--json", str(numbers)]) == 0
    assert "Without velocities neither their noise nor the observer's gain is identified" in capsys.readouterr().out
    of_joints = json.loads(numbers.read_text())["of_joints"]
    assert "torque noise [Nm]" not in [row["name"] for row in of_joints]
    assert of_joints[0]["name"] == "offset [Nm]"
    assert all(of_joints[0]["identified"])
    assert of_joints[0]["values"][2] == pytest.approx(-0.2, abs=0.1)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("q1_rad", "but no times (time_s) and no torques (tau_ext1_Nm ... or tau1_Nm ...): add columns"),
        ("time_s," + ",".join(f"q{j}_rad,tau{j}_Nm" for j in range(1, 8)), "an observer over them needs velocities"),
    ],
)
def test_columns_that_are_missing_are_named(tmp_path, header, said, capsys):
    place = tmp_path / "some.csv"
    count = len(header.split(","))
    place.write_text("\n".join([header, *(",".join([str(0.01 * i)] + ["0.1"] * (count - 1)) for i in range(5))]) + "\n")
    assert cli.main(["identify", str(place)]) == 2
    assert said in capsys.readouterr().err
