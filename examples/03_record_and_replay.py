"""Record a control loop, and recompute the recording. Prints what was recorded, and a comparison.

python examples/03_record_and_replay.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import pretouch as pt

arm = pt.RobotModel(pt.panda())
control = pt.Controller(arm, pt.paper_skin(arm), pt.no_fixtures(), pt.Circle(), pt.profile("paper"))
still, quiet = np.zeros(arm.n), np.zeros(6)
nothing = np.full(7, pt.RangeStatus.SIGNAL)

with TemporaryDirectory() as folder:
    place = Path(folder) / "run.mcap"
    q, qd = arm.description.q_ready, still
    state = control.init(pt.RobotState(0.0, q, qd, q, qd, still, quiet))
    with pt.Recording(place, control, {"what": "an arm that follows its commands exactly"}) as recording:
        for now in np.arange(1, 301) * control.limits.period:
            robot = pt.RobotState(now, q, qd, q, qd, still, quiet)
            inputs = pt.Inputs(now, robot, pt.RangeReadings(np.full(7, now), np.zeros(7), nothing))
            step, after = control.step(state, inputs)
            recording.record(pt.Cycle(inputs, state, step, after))
            state, qd = after, step.command
            q = q + qd * control.limits.period
    print(recording.close())

    recorded = pt.open_recording(place)
    speed = max(float(np.linalg.norm(cycle.step.ee_velocity)) for cycle in recorded)
    print(f"Fastest: {speed:.2f} m/s. {pt.verify(recorded).sentence}")
