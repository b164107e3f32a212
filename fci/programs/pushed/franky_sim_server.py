"""franky-sim's server, whose links can be pushed."""

from asked import LinkPush, obey
from franky_sim import SimulationServer
from franky_sim.mujoco_simulator import MujocoSimulator

with MujocoSimulator() as simulated:
    simulated.add_robot()
    with SimulationServer(simulated, hostname_candidates=["127.0.0.1"]) as server:
        model = simulated.model
        links = [model.body(f"robot0_fr3_link{number}").id for number in range(1, 8)]
        push = LinkPush(model, simulated.data, links)
        simulated.register_pre_step_callback(lambda _: push.apply())
        server.run_async()
        obey(push)
