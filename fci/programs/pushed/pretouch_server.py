"""`pretouch serve-fci --robot fr3`, whose links can be pushed."""

import threading

from asked import LinkPush, obey

from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sim.scene import SceneSpec
from pretouch_fci.arm import ServedArm, ServedSetup
from pretouch_fci.server import FciOptions, FciServer

model = RobotModel(robot_named("fr3"))
with ServedArm(ServedSetup(model, "fr3", model.description.q_ready.copy(), SceneSpec())) as arm:
    plant = arm.plant
    push = LinkPush(plant.mj_model, plant.mj_data, [plant.mj_model.jnt_bodyid[joint] for joint in range(7)])
    plant.before_each_step(lambda _time: push.apply())
    with FciServer(arm, FciOptions(), lambda *_: None, lambda *_: None) as server:
        asking = threading.Thread(target=obey, args=(push,))
        asking.start()
        server.serve(lambda: not asking.is_alive())
