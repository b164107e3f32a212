"""A Gymnasium environment with an optional shield between the policy and the arm."""

from pretouch.extras import Extra

LEARN = Extra("learn", ("gymnasium",), "learn", "pretouch-lab")
REACH = "pretouch/Reach-v0"


def _register() -> None:
    """Register the environment with Gymnasium at import; from release 1.4 Gymnasium loads no plugins."""
    if LEARN.missing("gymnasium"):
        return
    import gymnasium

    if REACH not in gymnasium.registry:
        gymnasium.register(REACH, entry_point="pretouch_lab.learning.environment:ReachEnv")


_register()
