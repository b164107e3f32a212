"""Units that sit elsewhere than they are said to, as their motion says, or how they would sit there."""

from pretouch.calibration.identify import Identified
from pretouch.calibration.locate import Located
from pretouch.calibration.mounting import likely_member, mounting_findings, seen_from, sits_well
from pretouch.calibration.result import Finding
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


def misplaced(model: RobotModel, given: dict[str, str | None], found: dict[str, Identified]) -> dict[str, Finding]:
    """Name units whose data fit another link than the one that they are said to sit on: by id.

    Args:
        model: the arm.
        given: link of each unit, as the user says.
        found: what is known of each unit's link.
    """
    findings = {}
    for name, link in given.items():
        if link is None or not found[name].body:
            continue
        said = model.link_index(link)
        links = _links(model, found[name], said)
        if said not in links:
            sentence = f"It is said to sit on {link}, but its data fit {_names(model, links)}: correct its link, or"
            findings[name] = Finding("wrong_link", f"{sentence} move it.", True)
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


def _seen_from(model: RobotModel, link: int, at: Located) -> FloatArray:
    """Pose (4, 4) of a unit on another link of the same rigid body."""
    return seen_from(model, link, at.link, at.pose, at.covariance)[0]


def _names(model: RobotModel, links: tuple[int, ...]) -> str:
    """Name links that have a surface, or all if none has."""
    covered = [i for i in links if i in model.capsules.link]
    return " or ".join(model.links[i] for i in covered or links)
