"""The task and its limits: path, speed reduction, approach restriction, joint box, quadratic program."""
