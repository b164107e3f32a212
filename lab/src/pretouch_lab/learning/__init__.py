"""A Gymnasium environment, with a shield between the policy and the arm or without."""

from pretouch.extras import Extra

LEARN = Extra("learn", ("gymnasium",), "learn", "pretouch-lab")
REACH = "pretouch/Reach-v0"


def _register() -> None:
    """Make the environment known to Gymnasium, which loads no plugins from release 1.4 on: this import does it."""
    if LEARN.missing("gymnasium"):
        return
    import gymnasium

    if REACH not in gymnasium.registry:
        gymnasium.register(REACH, entry_point="pretouch_lab.learning.environment:ReachEnv")


_register()
