"""The whole of the paper as a list of runs: every figure, table and study."""

from dataclasses import replace

from pretouch_lab.campaign import Request

_PROFILES = ("blind", "paper", "slowing-only", "thresholds-only", "paper-0.5m")
_STIFFNESS = (2_000.0, 25_000.0, 75_000.0, 300_000.0)
_MODES = ("hard", "slack", "floor")
_STUDIES = {"between": 12, "mounting": 6, "coverage": 4, "two-arms": 3}
"""Studies beside the paper's experiments, each with its number of seeds: together half an hour."""


def whole_paper(asked: Request) -> list[tuple[str, Request]]:
    """All runs of `pretouch reproduce all`, each with the name of its folder.

    `asked` gives skin and the number of seeds; a study has no more seeds than that, nor than its own
    number. Profiles, restrictions and stiffnesses that it names replace those of the paper's three experiments; where
    it has the defaults of a Request, these are varied as well.
    """
    plain = Request(asked.experiments, asked.seeds)
    profiles = _PROFILES if asked.profiles == plain.profiles else asked.profiles
    stiffness = _STIFFNESS if asked.stiffness == plain.stiffness else asked.stiffness
    runs = [
        ("static", replace(asked, experiments=("static",), profiles=profiles, stiffness=stiffness)),
        ("people", replace(asked, experiments=("avoidance", "dynamic"), profiles=profiles)),
    ]
    if not asked.restrictions and "paper" in profiles:
        runs.append(("restrictions", replace(asked, experiments=("static",), profiles=("paper",), restrictions=_MODES)))
    study = Request(("static",), asked.seeds, skin=asked.skin, world=asked.world)
    return runs + [
        (name, replace(study, experiments=(name,), seeds=min(asked.seeds, seeds))) for name, seeds in _STUDIES.items()
    ]
