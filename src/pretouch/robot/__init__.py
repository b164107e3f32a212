"""The arm: names and limits, kinematics and dynamics, and its body as capsules."""
