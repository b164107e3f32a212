"""The keys of sensor units: one random key of 32 bytes each, in a file that only its owner can read."""

import os
import secrets
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import tomli_w

from pretouch.atomic_write import atomic_write
from pretouch.errors import HardwareError
from pretouch.toml_files import parse_toml
from pretouch.units.wire import KEY_SIZE

_LAST_NUMBER = 0xFFFF
_SHOWN_BITS = 64


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
        if not isinstance(self.id, str) or not self.id or not self.id.isprintable():
            raise HardwareError(
                f"The name of a unit is {self.id!r}: give it a printable name, the one in the skin file."
            )
        if type(self.number) is not int or not 1 <= self.number <= _LAST_NUMBER:
            raise HardwareError(
                f"The number of unit {self.id} is {_described(self.number)}: choose 1 to {_LAST_NUMBER}."
            )
        if not isinstance(self.key, bytes) or len(self.key) != KEY_SIZE:
            size = f"{len(self.key)} bytes" if isinstance(self.key, bytes) else f"of type {type(self.key).__name__}"
            raise HardwareError(f"The key of unit {self.id} is {size}, not {KEY_SIZE} bytes: make one with new_key().")

    def __repr__(self) -> str:
        """Without the key: it must not get into logs."""
        return f"UnitKey(id={self.id!r}, number={self.number})"


def _described(number: object) -> str:
    """What stands in the place of a number: itself only if it is none of a key, which must not get into logs."""
    if not isinstance(number, int):
        return f"of type {type(number).__name__}"
    return str(number) if number.bit_length() <= _SHOWN_BITS else f"one of {number.bit_length()} bits"


class Keys(Mapping[str, UnitKey]):
    """Keys of units by name; two with the same name, number or key are a HardwareError."""

    def __init__(self, units: Iterable[UnitKey] = ()) -> None:
        by_id: dict[str, UnitKey] = {}
        by_number: dict[int, UnitKey] = {}
        by_key: dict[bytes, UnitKey] = {}
        for unit in units:
            if unit.id in by_id:
                raise HardwareError(f"Two units are named {unit.id}: give each its own name.")
            if unit.number in by_number:
                raise HardwareError(
                    f"Units {by_number[unit.number].id} and {unit.id} both have the number {unit.number}: renumber one."
                )
            if unit.key in by_key:
                raise HardwareError(f"Units {by_key[unit.key].id} and {unit.id} have the same key: make a new one.")
            by_id[unit.id] = by_number[unit.number] = by_key[unit.key] = unit
        self._by_id = by_id
        self.by_number: Mapping[int, UnitKey] = MappingProxyType(by_number)

    def __getitem__(self, id: str) -> UnitKey:
        return self._by_id[id]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_id)

    def __len__(self) -> int:
        return len(self._by_id)

    def __reduce__(self) -> tuple[type["Keys"], tuple[tuple[UnitKey, ...]]]:
        return Keys, (tuple(self.values()),)


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
    if hasattr(os, "geteuid") and status.st_uid != os.geteuid():
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
    if isinstance(table, dict) and set(table) == {"number", "key"} and isinstance(table["key"], str):
        with suppress(ValueError):
            return UnitKey(id, table["number"], bytes.fromhex(table["key"]))
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
