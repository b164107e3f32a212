"""The parameters of Table I as a page offers them: names, units, and what each does."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from types import MappingProxyType

from pretouch.composition import at, changed, leaves
from pretouch.composition import field_docs as of_kind
from pretouch.errors import ParameterError
from pretouch.profiles import PROFILES, Profile


def written(value: float) -> str:
    """Write a number as a person would."""
    return f"{value:.12g}"


@dataclass(frozen=True)
class TableEntry:
    """One row of Table I: the parameters it sets, one for each use in the paper."""

    symbol: str
    unit: str
    paths: tuple[str, ...]
    """Where each stands in a profile."""

    def text(self, profile: Profile) -> str:
        """Write its value in a profile; '' in one that has no such part."""
        values = dict(leaves(profile))
        return next((written(float(str(values[path]))) for path in self.paths if path in values), "")

    def write_text(self, profile: Profile, text: str) -> Profile:
        """Return the profile with a value that was typed; a ParameterError says what is wrong with it."""
        try:
            value = float(text)
        except ValueError as error:
            usual = self.text(PROFILES["paper"])
            raise ParameterError(f"{self.symbol} is {text!r}: give a number such as {usual}.") from error
        known = dict(leaves(profile))
        changes = {path: written(value) for path in self.paths if path in known}
        if not changes:
            raise ParameterError(f"{self.symbol} is no parameter of this profile: choose one with that part, as paper.")
        made: Profile = changed(profile, changes)
        return made

    @property
    def label(self) -> str:
        """Symbol and unit."""
        return f"{self.symbol} [{self.unit}]" if self.unit else self.symbol

    def hint(self) -> str:
        """What it does, from the documentation of its fields."""
        said = []
        for path in self.paths:
            group, _, name = path.rpartition(".")
            said.append(field_docs()[type(at(PROFILES["paper"], group)).__name__, name])
        return " ".join(said)


TABLE_1: tuple[TableEntry, ...] = (
    TableEntry("d_max", "m", ("slow.d_max_m", "detect.d_max_m")),
    TableEntry("d_min", "m", ("detect.d_min_m",)),
    TableEntry("l_max", "cycles", ("task.restore_cycles",)),
    TableEntry("V_max", "m/s", ("approach.v_max_m_s",)),
    TableEntry("d_repulse", "m", ("approach.d_repulse_m",)),
    TableEntry("d_crit", "m", ("approach.d_crit_m",)),
    TableEntry("d_notice", "m", ("approach.d_notice_m",)),
    TableEntry("alpha", "", ("window.alpha",)),
    TableEntry("beta", "", ("approach.beta",)),
    TableEntry("lambda", "", ("window.lambda_",)),
    TableEntry("F_std", "N", ("detect.f_std_n",)),
    TableEntry("F_d", "N", ("detect.f_d_n",)),
    TableEntry("F_b", "N", ("detect.f_base_n",)),
    TableEntry("sigma_max", "N", ("detect.sigma_max_n",)),
)


@cache
def field_docs() -> Mapping[tuple[str, str], str]:
    """What the source says of each field of the parameters, by (class, field), on one line; inherited ones too."""
    kinds: set[type] = {type(group) for profile in PROFILES.values() for group in groups_of(profile)}
    docs = {(kind.__name__, name): said for kind in kinds | {Profile} for name, said in of_kind(kind).items()}
    return MappingProxyType(docs)


def groups_of(params: object) -> Iterator[object]:
    """All sets of parameters that one holds, parts and those of parts included."""
    for item in fields(params) if is_dataclass(params) else ():
        value = getattr(params, item.name)
        for group in value if isinstance(value, tuple) else (value,):
            if is_dataclass(group):
                yield group
                yield from groups_of(group)
