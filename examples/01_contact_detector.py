"""The contact detector alone, on any force signal: thresholds that follow its statistics and the obstacles near.

    python examples/01_contact_detector.py

Its inputs are a force per sample and the positions of objects near, if any. Thresholds are lower towards an object: the
push here is not detected with nothing near, and is detected with a hand on that side.
"""

import numpy as np

import pretouch as pt

rng = np.random.default_rng(0)
force = rng.normal(0.0, 0.5, (400, 3))  # your signal [N], on the robot by the environment
force[300:, 1] -= 14.0  # somebody pushes towards -y

ee = np.array([0.5, 0.0, 0.3])
arm = pt.RobotModel(pt.panda())
posture, unit, aside = arm.kinematics(arm.description.q_ready), np.array([0]), np.array([[0.0, 1.0, 0.0]])
hand = pt.closest_points(posture, arm.body, ee, unit, point=ee + 0.2 * aside, last_direction=aside)

for name, near in {"nothing near": pt.no_obstacles(), "a hand 0.2 m away at +y": hand}.items():
    detector, params, result = pt.MovingThresholds(), pt.WindowParams(), "no contact"
    window = pt.window_init(params.samples)
    for i, sample in enumerate(force):
        armed, window = window.full, pt.add_force(window, sample, params)
        detection = detector.judge(window, sample, armed, ee, near)
        if detection.contact is not None:
            crossed = f"{window.newest[1]:.1f} N in y, filtered, is beyond {detection.thresholds.lower[1]:.1f} N"
            result = f"contact {i - 300} samples after the push began: {crossed}"
            break
    print(f"{name}: {result}")
