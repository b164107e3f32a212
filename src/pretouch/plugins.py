"""Parts that other distributions add by entry points: their names, and their objects, loaded at the first use."""

from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points

from pretouch.errors import PluginError


@cache
def _points(group: str) -> EntryPoints:
    """Look through all installed distributions, once: that takes some milliseconds."""
    return entry_points(group=group)


def names(group: str) -> tuple[str, ...]:
    """Return the names in a group of entry points, in order."""
    return tuple(sorted(_points(group).names))


def load(group: str, name: str) -> object:
    """Return the object that an entry point names.

    Raises PluginError where there is none of this name, where two distributions have one, and where its module or what
    it should hold cannot be loaded.
    """
    points = {point.value: point for point in _points(group).select(name=name)}
    if not points:
        raise PluginError(f"No installed distribution has {name!r} in the group {group!r}.")
    if len(points) > 1:
        owners = " and ".join(sorted(map(_owner, points.values())))
        raise PluginError(f"{name!r} in the group {group!r} is given by {owners}: uninstall one of them.")
    (point,) = points.values()
    try:
        return point.load()
    except Exception as error:  # a module of somebody else may raise anything
        raise PluginError(
            f"{name!r} of {_owner(point)} cannot be loaded from {point.value} ({type(error).__name__}: {error}):"
            " install that distribution again, or uninstall it."
        ) from error


def _owner(point: EntryPoint) -> str:
    return point.dist.name if point.dist else "an unknown distribution"
