"""The parameters of Table I as a page offers them: names, units, and what each does."""

import ast
import inspect
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from itertools import pairwise
from types import MappingProxyType

from pretouch.errors import ParameterError
from pretouch.params import PROFILES, Profile


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

    def read(self, profile: Profile) -> float:
        """Return its value in a profile."""
        group, name = self.fields[0]
        return float(getattr(getattr(profile, group), name))

    def write(self, profile: Profile, value: float) -> Profile:
        """Return the profile with another value; a ParameterError says what is wrong with it."""
        groups: dict[str, dict[str, float | int]] = {}
        for group, name in self.fields:
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
        """Write its value in a profile."""
        return written(self.read(profile))

    @property
    def label(self) -> str:
        """Symbol and unit."""
        return f"{self.symbol} [{self.unit}]" if self.unit else self.symbol

    def hint(self) -> str:
        """What it does, from the documentation of its fields."""
        groups = {f.name: f.default_factory for f in Profile.__dataclass_fields__.values()}
        return " ".join(field_docs().get((groups[g].__name__, name), "") for g, name in self.fields)  # type: ignore[union-attr]


TABLE_1: tuple[TableEntry, ...] = (
    TableEntry("d_max", "m", (("reduction", "d_max_m"), ("threshold", "d_max_m"))),
    TableEntry("d_min", "m", (("threshold", "d_min_m"),)),
    TableEntry("l_max", "cycles", (("reduction", "l_max_cycles"),)),
    TableEntry("V_max", "m/s", (("restriction", "v_max_m_s"),)),
    TableEntry("d_repulse", "m", (("restriction", "d_repulse_m"),)),
    TableEntry("d_crit", "m", (("restriction", "d_crit_m"),)),
    TableEntry("d_notice", "m", (("restriction", "d_notice_m"),)),
    TableEntry("alpha", "", (("threshold", "alpha"),)),
    TableEntry("beta", "", (("restriction", "beta"),)),
    TableEntry("lambda", "", (("threshold", "lambda_"),)),
    TableEntry("F_std", "N", (("threshold", "f_std_n"),)),
    TableEntry("F_d", "N", (("threshold", "f_d_n"),)),
    TableEntry("F_b", "N", (("threshold", "f_base_n"),)),
    TableEntry("sigma_max", "N", (("threshold", "sigma_max_n"),)),
)


@cache
def field_docs() -> Mapping[tuple[str, str], str]:
    """What the source says of each field of the parameters, by (class, field), on one line; inherited ones too."""
    docs: dict[tuple[str, str], str] = {}
    for kind in {type(group) for profile in PROFILES.values() for group in groups_of(profile)}:
        for base in reversed(kind.__mro__):
            docs |= {(kind.__name__, field): said for field, said in _told(base).items()}
    return MappingProxyType(docs)


def groups_of(params: object) -> Iterator[object]:
    """All sets of parameters that one holds, parts and those of parts included."""
    for item in fields(params) if is_dataclass(params) else ():
        value = getattr(params, item.name)
        for group in value if isinstance(value, tuple) else (value,):
            if is_dataclass(group):
                yield group
                yield from groups_of(group)


@cache
def _told(kind: type) -> Mapping[str, str]:
    """What the source of a class says of the fields that it adds."""
    if not is_dataclass(kind):
        return {}
    (node,) = ast.parse(inspect.getsource(kind)).body
    body = node.body if isinstance(node, ast.ClassDef) else []
    return {
        field.target.id: " ".join(str(ast.literal_eval(text.value)).split())
        for field, text in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(text, ast.Expr)
    }
