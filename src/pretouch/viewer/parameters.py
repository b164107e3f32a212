"""The parameters of Table I as a page offers them: names, units, and what each does."""

import ast
import inspect
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

from pretouch.errors import ParameterError
from pretouch.params import Profile


def written(value: float) -> str:
    """Write a number as a person would."""
    return f"{value:.12g}"


@dataclass(frozen=True)
class TableEntry:
    """One row of Table I: the fields it sets, one for each use in the paper."""

    symbol: str
    unit: str
    fields: tuple[tuple[str, str], ...]
    """(group of the profile, field) of each."""

    def read(self, profile: Profile) -> float | None:
        """Return its value in a profile; None where no part of that has it."""
        found = self._held(profile)
        return float(getattr(getattr(profile, found[0][0]), found[0][1])) if found else None

    def _held(self, profile: Profile) -> list[tuple[str, str]]:
        """Return those of the fields that the parts of a profile have."""
        return [(group, name) for group, name in self.fields if hasattr(getattr(profile, group), name)]

    def write(self, profile: Profile, value: float) -> Profile:
        """Return the profile with another value; a ParameterError says what is wrong with it."""
        groups: dict[str, dict[str, float | int]] = {}
        held = self._held(profile)
        if not held:
            raise ParameterError(f"{self.symbol} is a parameter of no part of this profile: choose a part that has it.")
        for group, name in held:
            kind = type(getattr(getattr(profile, group), name))
            groups.setdefault(group, {})[name] = int(value) if kind is int and value % 1 == 0 else value
        return replace(profile, **{g: replace(getattr(profile, g), **new) for g, new in groups.items()})

    def write_text(self, profile: Profile, text: str) -> Profile:
        """Return the profile with a value that was typed; a ParameterError says what is wrong with it."""
        try:
            value = float(text)
        except ValueError as error:
            raise ParameterError(f"{self.symbol} is {text!r}: give a number such as {self.text(profile)}.") from error
        return self.write(profile, value)

    def text(self, profile: Profile) -> str:
        """Write its value in a profile, nothing where there is none."""
        value = self.read(profile)
        return "" if value is None else written(value)

    @property
    def label(self) -> str:
        """Symbol and unit."""
        return f"{self.symbol} [{self.unit}]" if self.unit else self.symbol

    def hint(self) -> str:
        """What it does, from the documentation of its fields."""
        usual = Profile()
        owners = [(owner.__name__, name) for g, name in self.fields for owner in type(getattr(usual, g)).__mro__]
        return " ".join(field_docs().get(owner, "") for owner in owners).strip()


TABLE_1: tuple[TableEntry, ...] = (
    TableEntry("d_max", "m", (("slow", "d_max_m"), ("threshold", "d_max_m"))),
    TableEntry("d_min", "m", (("threshold", "d_min_m"),)),
    TableEntry("l_max", "cycles", (("task", "restore_cycles"),)),
    TableEntry("V_max", "m/s", (("approach", "v_max_m_s"),)),
    TableEntry("d_repulse", "m", (("approach", "d_repulse_m"),)),
    TableEntry("d_crit", "m", (("approach", "d_crit_m"),)),
    TableEntry("d_notice", "m", (("approach", "d_notice_m"),)),
    TableEntry("alpha", "", (("threshold", "alpha"),)),
    TableEntry("beta", "", (("approach", "beta"),)),
    TableEntry("lambda", "", (("threshold", "lambda_"),)),
    TableEntry("F_std", "N", (("threshold", "f_std_n"),)),
    TableEntry("F_d", "N", (("threshold", "f_d_n"),)),
    TableEntry("F_b", "N", (("threshold", "f_base_n"),)),
    TableEntry("sigma_max", "N", (("threshold", "sigma_max_n"),)),
)


@cache
def field_docs() -> Mapping[tuple[str, str], str]:
    """What the source says of each field of the parameters, by (class, field), on one line."""
    docs: dict[tuple[str, str], str] = {}
    groups = [type(getattr(Profile(), f.name)) for f in fields(Profile) if f.name != "name"]
    owners = {owner for group in groups for owner in group.__mro__ if is_dataclass(owner)}
    sources = {inspect.getsourcefile(owner) for owner in (*owners, Profile)}
    nodes = [node for path in sources if path for node in ast.parse(Path(path).read_text(encoding="utf-8")).body]
    for node in nodes:
        if not isinstance(node, ast.ClassDef):
            continue
        for field, text in zip(node.body, node.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(text, ast.Expr):
                said = ast.literal_eval(text.value)
                docs[node.name, field.target.id] = " ".join(str(said).split())
    return MappingProxyType(docs)
