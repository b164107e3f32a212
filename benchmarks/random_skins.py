"""How well coverage tells which of thirty random skins is touched unseen, by simulation.

Each skin has 4 to 32 units of one sensor type at random places all over the arm. Balls come at the moving arm as in
`pretouch reproduce coverage`; a contact is blind if nothing sensed was on the ball in time.
Printed are both shares of each skin and Spearman's rank correlation with its 95 % bounds (Fisher).

    python benchmarks/random_skins.py
    python benchmarks/random_skins.py vl53l1x 10    # another type of sensor, fewer skins
"""

import sys

import numpy as np
from scipy.stats import spearmanr

from pretouch.control.path import Circle
from pretouch.coverage.measure import Setting, covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.suggest import candidates
from pretouch.coverage.ways import seen_by
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import sensor_called
from pretouch.sensing.skin import Skin
from pretouch.sim.scene import GhostSpec, SceneSpec, fixtures
from pretouch_lab.experiment import Context
from pretouch_lab.experiments.coverage import COUNT, PARKED, ApproachingObstacles, results
from pretouch_lab.trial import play

FIRST_SEED = 1000
POSTURES = 20
LEAST, MOST = 4, 32
"""Units of a skin."""


def blind_share(model: RobotModel, skin: Skin, seed: int) -> float:
    """Share of the balls that reach the moving arm unseen."""
    params = CoverageParams()
    approaching = ApproachingObstacles(model, skin, params, COUNT, seed)
    parked = (float(PARKED[0]), float(PARKED[1]), float(PARKED[2]))
    setup = Context(model, skin).setup(
        {"profile": "pretouch"},
        seed,
        SceneSpec(ghost=GhostSpec(params.object_radius_m, parked)),
        Circle(),
        prepare=approaching.attach,
    )
    record = play(setup, lambda step, _: step.stamp >= approaching.end)
    found = results(approaching.came, record, params)
    return float(found["blind"] / found["came"])


def main() -> None:
    """Draw skins, foresee, simulate, print."""
    sensor = sensor_called(sys.argv[1] if len(sys.argv) > 1 else "vl53l5cx", "sensor", {})
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 30
    model = RobotModel(panda())
    setting = Setting(model, fixtures(SceneSpec()), CoverageParams(), "circle", POSTURES)
    ways, met = setting.ways(), setting.met()
    places = candidates(ways, Skin([], model), sensor)
    rows = []
    print(f"{'seed':>5} {'units':>5} {'ways [%]':>8} {'met [%]':>8} {'blind contacts [%]':>18}")
    for seed in range(FIRST_SEED, FIRST_SEED + count):
        rng = np.random.default_rng([seed, 56])
        drawn = rng.choice(len(places), rng.integers(LEAST, MOST + 1), replace=False)
        skin = Skin([places[i] for i in drawn], model)
        foreseen = [covered(some, seen_by(some, skin)).arm.ways for some in (ways, met)]
        rows.append([*foreseen, blind_share(model, skin, seed)])
        by_ways, by_met, blind = (100 * share for share in rows[-1])
        print(f"{seed:5} {len(drawn):5} {by_ways:8.0f} {by_met:8.0f} {blind:18.0f}", flush=True)
    found = np.array(rows)
    for name, column in (("ways", 0), ("met", 1)):
        r = float(spearmanr(found[:, column], found[:, 2]).statistic)
        low, high = np.tanh(np.arctanh(r) + np.array([-1.96, 1.96]) / np.sqrt(count - 3))
        print(f"rank correlation of {name} with blind contacts: {r:.2f} ({low:.2f} to {high:.2f})")


if __name__ == "__main__":
    main()
