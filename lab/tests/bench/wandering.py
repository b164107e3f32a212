from pretouch.controller import Controller


class WanderingController(Controller):
    """Sees and judges as any other, but moves along a course whatever that says."""

    def __init__(self, course, *parts):
        super().__init__(*parts)
        self.course = course

    def step(self, state, inputs):
        step, after = super().step(state, inputs)
        step.command = self.course.command(inputs.stamp, after.memory.get("watch.robot.q_commanded"))
        after.memory.put("command", step.command)
        return step, after
