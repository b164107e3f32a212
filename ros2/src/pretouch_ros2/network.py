"""Domain and network from settings and environment."""

import os
from collections.abc import Mapping

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant

from pretouch.errors import RobotError
from pretouch_ros2.params import ENVIRONMENT, LOOPBACK, NodeParams

_LOCAL = ("localhost", "lo", LOOPBACK)
_LARGEST_DOMAIN = 232
_XML = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface {chosen}/></Interfaces>"
    "<AllowMulticast>{multicast}</AllowMulticast></General>{discovery}</Domain></CycloneDDS>"
)
_BY_ASKING = (
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    f'<Peers><Peer address="{LOOPBACK}"/></Peers></Discovery>'
)
"""The loopback has no multicast: each of 33 participants is asked by itself, as rmw_cyclonedds does."""


_DOMAINS: dict[int, tuple[str, Domain]] = {}
"""Configuration and domain by its number: DDS has one network a domain, which a process keeps to its end."""


def domain_of(params: NodeParams, environment: Mapping[str, str] = os.environ) -> int:
    """Return the number of the domain; a ROS_DOMAIN_ID that is none is a RobotError."""
    if params.domain >= 0:
        return params.domain
    text = environment.get("ROS_DOMAIN_ID", "") or "0"
    if not text.isdecimal() or int(text) > _LARGEST_DOMAIN:
        raise RobotError(f"ROS_DOMAIN_ID is {text!r}: set it to a whole number from 0 to {_LARGEST_DOMAIN}.")
    return int(text)


def check_range(params: NodeParams, environment: Mapping[str, str] = os.environ) -> None:
    """Refuse a network that the environment keeps ROS from using: a RobotError."""
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    if reach == "OFF":
        raise RobotError("ROS_AUTOMATIC_DISCOVERY_RANGE is OFF, so nothing would be found: set it to LOCALHOST.")
    local = reach == "LOCALHOST" or environment.get("ROS_LOCALHOST_ONLY", "") == "1"
    if local and params.interface not in _LOCAL:
        name = "ROS_AUTOMATIC_DISCOVERY_RANGE" if reach == "LOCALHOST" else "ROS_LOCALHOST_ONLY"
        raise RobotError(
            f"{name} keeps ROS on this machine, but the interface is {params.interface!r}: unset {name}, or leave the"
            " interface out."
        )


def participant(params: NodeParams) -> DomainParticipant:
    """Join the domain; what keeps the node from it is a RobotError."""
    check_range(params)
    number = domain_of(params)
    first = number not in _DOMAINS
    try:
        if params.interface != ENVIRONMENT:
            _configure(number, _configuration(params.interface))
        return DomainParticipant(number)
    except DDSException as error:
        if first:
            _DOMAINS.pop(number, None)
        raise RobotError(
            f"The domain {number} cannot be joined through the interface {params.interface!r}: give the address or name"
            f" of an interface of this machine, or {LOOPBACK} ({error})."
        ) from error


def _configuration(interface: str) -> str:
    local = interface in _LOCAL
    kind = "address" if local or interface[0].isdigit() or ":" in interface else "name"
    return _XML.format(
        chosen=f'{kind}="{LOOPBACK if local else interface}"' + (' multicast="false"' if local else ""),
        multicast="false" if local else "default",
        discovery=_BY_ASKING if local else "",
    )


def _configure(number: int, xml: str) -> None:
    if number not in _DOMAINS:
        _DOMAINS[number] = xml, Domain(number, xml)
    if _DOMAINS[number][0] != xml:
        raise RobotError(f"Domain {number} was joined by this program with another interface: use one for both.")
