"""Contact-anticipating control for robot arms with onboard proximity sensing.

The public names are attributes of this module and are loaded at their first use: `import pretouch` loads nothing. The
names stand in `__init__.pyi`. (PYTEST_DONT_REWRITE: a program that has imported this and then begins a test run is not
warned that pytest came too late to rewrite assertions.)
"""

import re
from importlib import import_module
from pathlib import Path as _File

__version__ = "0.2.0"

_STUB = _File(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_PLACE = {name: module for module, name in re.findall(r"^from (\S+) import (\w+) as \2$", _STUB, re.MULTILINE)}
"""Module of each name; that of a module of this package is `pretouch`."""

__all__ = sorted(_PLACE)


def __getattr__(name: str) -> object:
    if name not in _PLACE:
        raise AttributeError(f"module 'pretouch' has no attribute {name!r}")
    place = _PLACE[name]
    attribute = import_module(f"pretouch.{name}") if place == __name__ else getattr(import_module(place), name)
    globals()[name] = attribute
    return attribute


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
