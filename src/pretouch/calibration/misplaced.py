"""Units that sit elsewhere than they are said to, as their motion tells, or how they would sit there."""

from pretouch.calibration.identify import Identified
from pretouch.calibration.locate import Located
from pretouch.calibration.mounting import likely_member, mounting_findings, seen_from, sits_well
from pretouch.calibration.result import Finding
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


def misplaced(model: RobotModel, given: dict[str, str | None], found: dict[str, Identified]) -> dict[str, Finding]:
    """Name units that sit elsewhere than they are said to: by id. Those that sit in each other's place are swapped.

    Args:
        model: the arm.
        given: link of each unit, as the user says.
        found: what is known of each unit's link.
    """
    said = {name: model.link_index(link) for name, link in given.items() if link is not None and found[name].body}
    links = {name: _links(model, found[name], link) for name, link in said.items()}
    for name in [name for name in said if said[name] not in links[name]]:
        # of two that exchanged their places, one may look as if it sat where it is said to
        for other, link in said.items():
            if link in links[name] and _nearest(model, found[other], link) == said[name]:
                links[other] = (said[name],)
    wrong = [name for name in said if said[name] not in links[name]]
    owners = {name: [other for other in wrong if other != name and said[other] in links[name]] for name in wrong}
    findings = {}
    for name in wrong:
        ring = _ring(name, owners)
        words = _Words(model.links[said[name]], _names(model, links[name]))
        findings[name] = words.swapped(ring) if ring else words.alone(owners[name])
    return findings


def _links(model: RobotModel, found: Identified, said: int) -> tuple[int, ...]:
    """Return the links a unit may sit on, among them the one it is said to sit on if that may be."""
    at = found.located
    if said not in found.body or at is None:
        return found.body
    there = _seen_from(model, said, at)
    if not any(finding.refused for finding in mounting_findings(model, said, there)):
        return found.body
    better = likely_member(model, found.body, said, there)
    return (better,) if sits_well(model, better, _seen_from(model, better, at)) else found.body


def _nearest(model: RobotModel, found: Identified, said: int) -> int:
    """Return the link, of those fixed to the one it is said to sit on, that a unit most likely sits on."""
    at = found.located
    if at is None or said not in found.body:
        return said
    return likely_member(model, found.body, said, _seen_from(model, said, at))


def _seen_from(model: RobotModel, link: int, at: Located) -> FloatArray:
    """Pose (4, 4) of a unit on another link of the same rigid body."""
    return seen_from(model, link, at.link, at.pose, at.covariance)[0]


def _ring(name: str, owners: dict[str, list[str]]) -> list[str]:
    """Return the fewest units each of which sits where the next one should, from `name` back to it; none if so."""
    paths, seen = [[name]], {name}
    while paths:
        path = paths.pop(0)
        if len(path) > 1 and name in owners[path[-1]]:
            return path
        fresh = [other for other in owners[path[-1]] if other not in seen]
        seen.update(fresh)
        paths += [[*path, other] for other in fresh]
    return []


def _names(model: RobotModel, links: tuple[int, ...]) -> str:
    """Name links that have a surface, or all if none has."""
    covered = [i for i in links if i in model.capsules.link]
    return " or ".join(model.links[i] for i in covered or links)


class _Words:
    """What is said of a unit: the link it should sit on, and those it may sit on."""

    def __init__(self, said: str, links: str) -> None:
        self.said, self.links = said, links

    def alone(self, owners: list[str]) -> Finding:
        sentence = f"It is said to sit on {self.said}, but its data fit {self.links}: correct its link, or move it."
        if owners:
            sentence = f"It sits on {self.links}, where {owners[0]} should sit, instead of on {self.said}: correct its"
            sentence += " link, or move it."
        return Finding("wrong_link", sentence, True)

    def swapped(self, ring: list[str]) -> Finding:
        others = ring[1:]
        sentence = f"Swapped with {' and '.join(others)}: it sits on {self.links}, where {others[0]} should, instead"
        sentence += f" of on {self.said}"
        if len(others) == 1:
            return Finding("swapped", f"{sentence}; exchange the two, or their ids.", True)
        return Finding("swapped", f"{sentence}, where {others[-1]} sits; exchange them, or their ids.", True)
