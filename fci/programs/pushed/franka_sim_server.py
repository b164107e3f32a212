"""franka-sim's server, whose links can be pushed."""

import logging
import threading
import time

from asked import LinkPush, obey
from franka_sim import FrankaSimServer

logging.disable(logging.WARNING)
server = FrankaSimServer(physics="mujoco")
threading.Thread(target=server.start, daemon=True).start()
simulated = server.physics_sim
while simulated.arm_dofs_idx is None:  # it builds its model as it starts
    time.sleep(0.1)
push = LinkPush(simulated.model, simulated.data, [simulated.model.dof_bodyid[dof] for dof in simulated.arm_dofs_idx])
step = simulated._apply_control
simulated._apply_control = lambda: (push.apply(), step())  # it has no call of its own before a step
obey(push)
