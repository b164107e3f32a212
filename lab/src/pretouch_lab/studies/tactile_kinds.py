"""The trials of the study of touch sensors, and their contacts: where, how hard, how long."""

NAME = "tactile"
PROFILE = "pretouch"
WARM_UP_S = 60.0
"""Time before the first contact, in which free motion is learnt [s]: as in the benchmark of detection."""
FREE_S = 180.0
"""Time in which alarms are counted where there are no contacts [s]."""
COUNT = 30
"""Contacts of a trial."""

ON_PATCH, BESIDE, INNER, NOWHERE = "on patch", "beside", "inner links", "nowhere"
"""Where contacts are: on a unit's patch, on the same link off all patches, on a patch of links 1 to 4, which get units
for it, or none at all."""
FORCES_N: tuple[float, ...] = (2.0, 5.0, 10.0, 15.0, 30.0)
KINDS: tuple[tuple[int, float, float], ...] = ((0, 0.06, 0.005), (1, 0.2, 0.02))
"""Index of the kind in the benchmark's scenario, duration and rise [s]: a tap and a push."""
INNER_LINKS = ("link1", "link2", "link3", "link4")
INNER_N: tuple[float, ...] = (15.0, 30.0, 60.0)
INNER_KINDS = KINDS[1:]
"""The same on these links [N]: the torques tell little of less there."""
