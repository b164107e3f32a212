"""What `pretouch skin keys` does: the units of a file of keys, listed, added to, or without those that were lost."""

from dataclasses import dataclass
from pathlib import Path

from pretouch.cli.options import JsonFile, Words
from pretouch.cli.writing import numbers_to
from pretouch.units.keys import Keys, load_keys, save_keys


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
            keys = keys_or_none(self.keys) if self.new and not self.revoke else load_keys(self.keys)
            if self.new or self.revoke:
                keys = keys.without(self.revoke).with_new(self.new)
                save_keys(keys, self.keys)
            if self.revoke:
                names = ", ".join(self.revoke)
                print(f"Revoked: {names}. A receiver that runs goes on with the keys it has read: start it anew.")
            units = [{"unit": u.id, "number": u.number, "fingerprint": u.fingerprint} for u in keys.values()]
            for unit in units:
                print("{unit}: number {number}, key {fingerprint}...".format(**unit))
            write({"units": units})


def keys_or_none(place: Path) -> Keys:
    """Read a file of keys; one that is not there holds none."""
    return load_keys(place) if place.exists() else Keys()
