"""One step of the controller in ten lines; in your own loop, fill in the reports of robot and skin."""

import numpy as np

import pretouch as pt

arm = pt.RobotModel(pt.panda())
control = pt.Controller(arm, pt.paper_skin(arm), pt.no_fixtures(), pt.Circle(), pt.profile("paper"))
q, rest = arm.description.q_ready, np.zeros(7)
robot = pt.RobotState(stamp=0.0, q=q, qd=rest, q_commanded=q, qd_commanded=rest, tau_ext=rest, wrench=np.zeros(6))
readings = pt.RangeReadings(stamp=np.zeros(7), distance=np.full(7, 0.4), status=np.zeros(7, np.int64))
state = control.init(robot)
step, state = control.step(state, pt.Inputs(0.0, robot, readings))
print(f"{step.mode.value}: {step.reason}")
print("joint velocities to send [rad/s]:", step.command)
