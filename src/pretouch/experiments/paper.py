"""The whole of the paper as a list of runs: every figure, table, claim and weakness."""

from dataclasses import replace

from pretouch.experiments.campaign import Request

_PROFILES = ("blind", "paper", "slowing-only", "thresholds-only", "paper-0.5m")
_STIFFNESS = (2_000.0, 25_000.0, 75_000.0, 300_000.0)


def whole_paper(asked: Request) -> list[tuple[str, Request]]:
    """All runs of `pretouch reproduce all`, each with the name of its folder.

    `asked` gives seeds, skin and orientation of all of them. Profiles, restrictions and stiffnesses it names replace
    those of the three experiments of the paper; where it has the defaults of a Request, these are varied as well.
    """
    plain = Request(asked.experiments, asked.seeds)
    profiles = _PROFILES if asked.profiles == plain.profiles else asked.profiles
    stiffness = _STIFFNESS if asked.stiffness == plain.stiffness else asked.stiffness
    people = replace(asked, experiments=("avoidance", "dynamic"), profiles=profiles)
    static = replace(asked, experiments=("static",), profiles=profiles, stiffness=stiffness)
    runs = [("people", people), ("static", static)]
    if not asked.restrictions:
        modes = ("hard", "slack", "floor")
        runs.append(("restrictions", replace(asked, experiments=("static",), profiles=("paper",), restrictions=modes)))
    return runs
