"""Prints what the house is like beside what is aimed at, and fails where it is beyond what is held."""

import subprocess
import sys
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from statistics import median, quantiles

from tools.house.source import Source, import_cycle

from pretouch.profiles import PROFILES

ROOT = Path(__file__).parents[2]
_TIMES = 5
_IMPORT = "import time; t = time.process_time(); import pretouch; print(time.process_time() - t)"


@dataclass(frozen=True)
class Measure:
    """A number of the house. Beyond `held` the check fails: lower it when the number falls.

    Lines and files were raised once, by 1110 and 4, for what a first hour needs: the opening, hand and three arms of
    the live page, the sentence that explains a step, a first start that says what it does, hints for each installation.
    Once more, by 1900 and 17, for `pretouch detect` on the joint torques of anybody's arm: tables, bags, an
    observer, checks of sign, unit and order, pushes that are tried, figure and page.
    Then by 215 and 1 for a bound on how far a contact moves the arm and for light touches that are no object, and by
    350 and 3 for what the model of free motion cannot express, 162 and 1 for the force that is found, 223 and 2 for
    loads that a program announces, 368 and 2 for the door of the pages, 289 and 4 for bounds on files from elsewhere.
    Those of product and lab by 667, for the detectors on recordings of real arms. Both by 80 for faults of the arm's
    side, the user stop of the served arm, and waits with an end; those of product and lab by 11 more. Then by 448 and
    5, for a commander in place of the path (275) and for what a review as an attacker found: memory, pipes, terminals,
    topics; and a profile's parameters by one, after which a commander's silence counts. Then those of the product by
    907 and 8 for commanders over ROS 2 (371), on the page (410) and in programs with loops of their own, and those of
    the lab by 2097, for the benchmark of commanders (1320) and learning under the shield. Both by 25 for recorded steps
    that are of another arm than the recording says, by 214 and 2 files for types of sensor, and by 118
    and 1 for recordings of hours that keep little in memory, and by 408 and 3 for physics steps and rays in compiled
    calls, a step and a start that are faster, and
    by 12 for a page whose memory stays flat, and by 211 for sensors with zones, and by 171
    and 1 for what the arm runs into by itself (coverage), and points that are kept where nobody looks any more, which
    is a parameter of a profile; and by 227 and 1 for a bound on the speed where no unit looks, which is another, and by
    399 and 4 for capacitive electrodes and the map that is learnt of them, 185 and 1 for zones in datagrams, 104 and 1
    for budgets of units, 23 for provisioning units with zones and for a profile of such skins, 1002 and 6 for a fixture
    of other people's tests, three more kinds of motion and the gripper of a simulated Franka. Then by 1838 and 12 for
    the rest of it and for other arms: torques, impedances, loads, guiding, targets and self-collision (420), the
    Panda's model library and worlds from files (200), two arms in one world (725), arms by name on page and in
    rehearsals, and places found by rule (430); those of the lab by 403, for what measures these.
    """

    name: str
    value: float
    held: float
    aim: float | None = None
    where: str = ""
    least: bool = False
    """Whether the number is to be at least what is held, in place of at most."""

    @property
    def kept(self) -> bool:
        """Whether the number is within what is held."""
        return self.value >= self.held if self.least else self.value <= self.held


def measures() -> list[Measure]:
    """Measure the house."""
    product, lab = Source(ROOT / "src/pretouch"), Source(ROOT / "lab/src/pretouch_lab")
    functions = product.functions + lab.functions
    longest_file = max((product.files | lab.files).items(), key=lambda item: item[1])
    longest, widest = max(functions, key=lambda f: f.lines), max(functions, key=lambda f: f.parameters)
    cycle = import_cycle([package.folder.name for package in (product, lab) if package.files])
    values = [
        value for group in fields(PROFILES["pretouch"]) for value in _values(getattr(PROFILES["pretouch"], group.name))
    ]
    return [
        Measure("lines of the product, comments aside", product.lines, 60_926, 35_000),
        Measure("files of the product", len(product.files), 499, 300),
        Measure("lines of product and lab, likewise", product.lines + lab.lines, 84_202, 50_000),
        Measure("lines of the largest file", longest_file[1], 350, 350, str(longest_file[0].relative_to(ROOT))),
        Measure("most parameters of a function", widest.parameters, 8, 8, widest.place),
        Measure("functions of more than 8 parameters", sum(f.parameters > 8 for f in functions), 0, 0),
        Measure("lines of functions, 95th percentile", quantiles([f.lines for f in functions], n=20)[-1], 27),
        Measure("lines of the longest function", longest.lines, 60, 60, longest.place),
        *(_comments(package) for package in ("control", "contact", "perception")),
        Measure("lines of README", len((ROOT / "README.md").read_text().splitlines()), 150, 150),
        Measure("parameters of a profile", len(values), 125, 140),
        Measure("booleans among them", sum(isinstance(value, bool) for value in values), 7, 6),
        Measure("import pretouch, processor [s]", _import_s(), 0.05, 0.05),
        Measure("modules in an import cycle", len(cycle), 0, 0, " > ".join(cycle)),
    ]


def _comments(package: str) -> Measure:
    share = Source(ROOT / "src/pretouch" / package).comment_share
    return Measure(f"comments in {package} [%]", round(100 * share, 1), 5, 5, least=True)


def _values(group: object) -> list[object]:
    if not is_dataclass(group):
        return [group]
    return [value for field in fields(group) for value in _values(getattr(group, field.name))]


def _import_s() -> float:
    """Return the median processor time of the package's import, each in a process of its own."""
    command = [sys.executable, "-c", _IMPORT]
    return median(float(subprocess.run(command, capture_output=True, check=True).stdout) for _ in range(_TIMES))


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def main() -> int:
    """Print the measures; return 1 where one is beyond what is held."""
    found = measures()
    print(f"{'':42}{'now':>8}{'held':>8}{'aim':>8}")
    for measure in found:
        numbers = "".join(f"{_number(number):>8}" for number in (measure.value, measure.held, measure.aim))
        print(f"{measure.name:42}{numbers}  {'' if measure.kept else 'BEYOND '}{measure.where}".rstrip())
    beyond = [measure.name for measure in found if not measure.kept]
    if beyond:
        print(f"Beyond what is held: {', '.join(beyond)}. Make it smaller, or say in tools/house why it must grow.")
    return int(bool(beyond))


if __name__ == "__main__":
    sys.exit(main())
