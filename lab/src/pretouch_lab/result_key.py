"""The key of results that are kept: a run that goes on takes up none that another program would make otherwise."""

import json
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from hashlib import sha256

from pretouch.profiles import Profile
from pretouch.recording.versions import libraries
from pretouch.source_digest import source_digest


def result_key(*functions: Callable[..., object], profile: Profile | None = None) -> str:
    """Return a key of what some functions make, with a profile if that is not named elsewhere.

    Another is made of another source text of all that the functions rest on, of other data files of its packages, of
    other parameters, and of other versions of the libraries that compute: a solver or a simulator of another version
    gives other numbers.
    """
    parameters = parameters_digest(profile) if profile else ""
    return sha256(f"{parameters} {_code(functions)}".encode()).hexdigest()[:12]


def parameters_digest(profile: Profile) -> str:
    """Return what tells a profile's parameters from any others."""
    return sha256(json.dumps(asdict(profile), sort_keys=True, default=repr).encode()).hexdigest()


@cache
def _code(functions: tuple[Callable[..., object], ...]) -> str:
    return f"{source_digest(*functions)} {sorted(libraries().items())}"
