"""What `pretouch skin keys` does: the units of a file of keys, listed, added to, or without those that were lost."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from pretouch.cli.options import JsonFile, Words
from pretouch.cli.writing import numbers_to
from pretouch.errors import HardwareError
from pretouch.units.keys import Keys, UnitKey, load_keys, new_key, save_keys
from pretouch.units.provision import fingerprint


@dataclass(frozen=True)
class ListKeys:
    """List the units of a file of keys, add some with random keys to try `simulate` and `monitor`, or revoke keys."""

    keys: Path
    """File of the units' keys; created if it is missing, readable only by you."""
    new: Words = ()
    """Names of units to add, separated by commas."""
    revoke: Words = ()
    """Names of units whose keys no longer count, separated by commas: lost or stolen. The others keep theirs."""
    json: JsonFile = None

    def run(self) -> None:
        """Print name, number and fingerprint of each unit, after revoking keys and adding names."""
        with numbers_to(self.json) as write:
            write(list_keys(self.keys, self.new, self.revoke))


def list_keys(place: Path, new: Sequence[str] = (), revoke: Sequence[str] = ()) -> dict[str, Any]:
    """Print name, number and fingerprint of each unit in a file, after revoking keys and adding names; return them."""
    keys = keys_or_none(place) if new and not revoke else load_keys(place)
    if new or revoke:
        keys = with_new(without(keys, revoke), new)
        save_keys(keys, place)
    if revoke:
        print(f"Revoked: {', '.join(revoke)}. A receiver that runs goes on with the keys it has read: start it anew.")
    listed = [{"unit": u.id, "number": u.number, "fingerprint": fingerprint(u.key)} for u in keys.values()]
    for unit in listed:
        print("{unit}: number {number}, key {fingerprint}...".format(**unit))
    return {"units": listed}


def keys_or_none(place: Path) -> Keys:
    """Read a file of keys; one that is not there holds none."""
    return load_keys(place) if place.exists() else Keys()


def with_new(keys: Keys, names: Sequence[str]) -> Keys:
    """Return keys with new ones for some names, under the first free numbers. One there already is a HardwareError."""
    there = [name for name in names if name in keys]
    if there:
        raise HardwareError(f"{', '.join(there)} already has a key: give other names.")
    for name in names:
        keys = Keys([*keys.values(), UnitKey(name, free_number(keys), new_key())])
    return keys


def without(keys: Keys, names: Sequence[str]) -> Keys:
    """Return keys without those of some names; a name there is not is a HardwareError."""
    absent = [name for name in names if name not in keys]
    if absent:
        raise HardwareError(f"{', '.join(absent)} has no key to revoke: give names of {', '.join(keys) or 'no unit'}.")
    return Keys(unit for unit in keys.values() if unit.id not in names)


def free_number(keys: Keys) -> int:
    """Return the first number that no unit has."""
    return next(n for n in count(1) if n not in keys.by_number)
