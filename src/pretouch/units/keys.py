"""The keys of sensor units: one random key of 32 bytes each, in a file that only its owner can read."""

import os
import secrets
import stat
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Self

import tomli_w

from pretouch.atomic_write import atomic_write
from pretouch.errors import HardwareError
from pretouch.toml_files import parse_toml

KEY_SIZE = 32
_LAST_NUMBER = 0xFFFF
_NO_SECRET = 10**9
"""A number below this is no key, which must not get into logs."""


@dataclass(frozen=True)
class UnitKey:
    """Name, number and key of one sensor unit; what cannot be one is a HardwareError."""

    id: str
    """Its name in the skin."""
    number: int
    """Its number in datagrams, 1 to 65535."""
    key: bytes
    """32 random bytes that only the unit and its receiver know."""

    def __post_init__(self) -> None:
        if not (isinstance(self.id, str) and self.id and self.id.isprintable()):
            name = repr(self.id) if isinstance(self.id, str) else "no text"  # but a key, which must not get into logs
            raise HardwareError(f"The name of a unit is {name}: give it a printable name, the one in the skin file.")
        if type(self.number) is not int or not 1 <= self.number <= _LAST_NUMBER:
            value = self.number if isinstance(self.number, int) and abs(self.number) < _NO_SECRET else "none"
            raise HardwareError(f"The number of unit {self.id} is {value}: choose 1 to {_LAST_NUMBER}.")
        if not isinstance(self.key, bytes) or len(self.key) != KEY_SIZE:
            size = f"{len(self.key)} bytes" if isinstance(self.key, bytes) else "no bytes"
            raise HardwareError(f"The key of unit {self.id} is {size}, not {KEY_SIZE} bytes: make one with new_key().")

    def __repr__(self) -> str:
        """Return a text without the key, which must not get into logs."""
        return f"UnitKey(id={self.id!r}, number={self.number})"

    @property
    def fingerprint(self) -> str:
        """First 8 hex digits of the SHA-256: they identify a key without revealing it."""
        return sha256(self.key).hexdigest()[:8]


class Keys(dict[str, UnitKey]):
    """Immutable keys of units by name; two of one name, number or key are a HardwareError."""

    def __init__(self, units: Iterable[UnitKey] = ()) -> None:
        super().__init__()
        for unit in units:
            for other in self.values():
                if unit.id == other.id:
                    raise HardwareError(f"Two units are named {unit.id}: give each its own name.")
                if unit.number == other.number:
                    raise HardwareError(
                        f"Units {other.id} and {unit.id} both have the number {unit.number}: renumber one."
                    )
                if unit.key == other.key:
                    raise HardwareError(f"Units {other.id} and {unit.id} have the same key: make a new one.")
            self[unit.id] = unit

    @property
    def by_number(self) -> dict[int, UnitKey]:
        """The units by their numbers in datagrams."""
        return {unit.number: unit for unit in self.values()}

    @property
    def free_number(self) -> int:
        """The first number that no unit has."""
        return next(number for number in count(1) if number not in self.by_number)

    def with_new(self, names: Sequence[str]) -> Self:
        """Return keys with new ones for some names, under free numbers. One there already is a HardwareError."""
        present = [name for name in names if name in self]
        if present:
            raise HardwareError(f"{', '.join(present)} already has a key: give other names.")
        keys = self
        for name in names:
            keys = type(self)([*keys.values(), UnitKey(name, keys.free_number, new_key())])
        return keys

    def without(self, names: Sequence[str]) -> Self:
        """Return keys without those of some names; an unknown name is a HardwareError."""
        absent = [name for name in names if name not in self]
        if absent:
            raise HardwareError(
                f"{', '.join(absent)} has no key to revoke: give names of {', '.join(self) or 'no unit'}."
            )
        return type(self)(unit for unit in self.values() if unit.id not in names)


def new_key() -> bytes:
    """Draw a key."""
    return secrets.token_bytes(KEY_SIZE)


def load_keys(path: Path) -> Keys:
    """Read a file of keys; one that another owns or may read, or that holds no keys, is a HardwareError."""
    try:
        with open(path, "rb") as file:
            _demand_private(os.fstat(file.fileno()), path)
            text = file.read()
    except OSError as error:
        raise HardwareError(f"The keys in {path} cannot be read: {error.strerror}.") from None
    except ValueError as error:
        raise HardwareError(f"{str(path)!r} cannot be a file name: {error}.") from None
    try:
        tables = parse_toml(text)
    except ValueError as error:
        raise HardwareError(f"{path} is not a TOML file of keys: {error}.") from None
    try:
        return Keys(_unit(id, table) for id, table in tables.items())
    except HardwareError as error:
        raise HardwareError(f"{path}: {error}") from None


def _demand_private(status: os.stat_result, path: Path) -> None:
    if status.st_uid != os.geteuid():
        raise HardwareError(
            f"{path} belongs to user {status.st_uid}, who can read its keys: make yourself its owner (chown"
            f" {os.geteuid()} {path})."
        )
    mode = stat.S_IMODE(status.st_mode)
    if mode & 0o077:
        raise HardwareError(
            f"{path} has the mode {mode:04o}, so others can read its keys: run chmod 600 {path}, and make new keys if"
            " somebody may have read them."
        )


def _unit(id: str, table: object) -> UnitKey:
    """Return the unit of a table of the file."""
    try:
        match table:
            case {"number": number, "key": str(key), **others} if not others:
                return UnitKey(id, number, bytes.fromhex(key))
    except ValueError:
        pass
    raise HardwareError(
        f"Unit {id!r} must have a number and a key of {2 * KEY_SIZE} hexadecimal digits, and nothing else."
    )


def save_keys(keys: Keys, path: Path) -> None:
    """Write a file of keys that only its owner can read; it is replaced whole or, with a HardwareError, not at all."""
    tables = {unit.id: {"number": unit.number, "key": unit.key.hex()} for unit in keys.values()}
    try:
        atomic_write(path, tomli_w.dumps(tables), private=True)
    except OSError as error:
        raise HardwareError(f"The keys cannot be written to {path}: {error.strerror}.") from None
    except ValueError as error:
        raise HardwareError(f"{str(path)!r} cannot be a file name: {error}.") from None
