"""The approach restrictions (eqs. 5-7) as rows G qd <= h, in a quadratic program of your own.

    python examples/02_rows_for_your_own_qp.py

SciPy solves the program here; the rows and the joint box are plain arrays for any solver.
"""

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, minimize

import pretouch as pt

arm = pt.RobotModel(pt.panda())
q, qd = arm.description.q_ready, np.zeros(7)
kin = arm.kinematics(q)
ee, J = kin.position[arm.ee], arm.ee_jacobian(kin)[:3]

# obstacle points from a source of yours: a skin, a camera, a map
points = ee + np.array([[0.12, 0.0, 0.05], [0.0, 0.3, 0.0]])
near = pt.closest_points(kin, arm.body, ee, np.arange(2), points, np.tile([1.0, 0.0, 0.0], (2, 1)))
rows = pt.approach_rows(kin, arm.moved_by, near, pt.row_numbers(pt.ApproachRestriction(rows="hard")))
lower, upper, _ = pt.joint_box(q, qd, pt.joint_limits(arm, margin=0.01, period=0.01).table)

velocity = np.array([0.1, 0.0, 0.0])  # desired, towards the nearer point [m/s]
H, f = J.T @ J + 1e-3 * np.eye(7), -J.T @ velocity
for name, limits in (("free", []), ("restricted", [LinearConstraint(rows.G, ub=rows.h)])):
    program = {"bounds": Bounds(lower, upper), "constraints": limits, "options": {"ftol": 1e-12}}
    x = minimize(lambda x: 0.5 * x @ H @ x + f @ x, qd, jac=lambda x: H @ x + f, method="SLSQP", **program).x
    approach = rows.G @ x
    print(f"{name}: hand {(J @ x).round(3)} m/s, approach to the points {approach.round(3)} of {rows.h.round(3)} m/s")
