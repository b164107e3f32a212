"""Learning with a shield: a Gymnasium environment, and a policy that is trained alone and under Pretouch."""

from pretouch.extras import Extra

LEARN = Extra("learn", ("gymnasium", "stable_baselines3"), "learn", "pretouch-lab")
REACH = "pretouch/Reach-v0"


def _register() -> None:
    """Make the environment known to Gymnasium, which loads no plugins from release 1.4 on: this import does it."""
    if LEARN.missing("gymnasium"):
        return  # the command says so
    import gymnasium

    if REACH not in gymnasium.registry:
        gymnasium.register(REACH, entry_point="pretouch_lab.learning.environment:ReachEnv")


_register()
