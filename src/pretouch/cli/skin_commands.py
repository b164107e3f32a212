"""What can be said after `pretouch skin`: one dataclass a command, its docstrings are the help."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from pretouch.arms import arm_class
from pretouch.cli.calibrate.options import Calibrate, CalibrateArm
from pretouch.cli.words import split_arm
from pretouch.units.udp import HOST, PORT


@dataclass(frozen=True)
class Coverage:
    """Share of the paths to the arm on which a skin sees an object in time; blind spots; where more units help most."""

    skin: tyro.conf.Positional[str] = ""
    """Skin file; by default the seven units that come with the package, or the skin in the arm's folder."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    workspace: str = "paths"
    """Postures to average over: circle, line, paths (both of the paper's), or joints (their whole range)."""
    speed: float = 0.5
    """Speed of the approaching object [m/s]."""
    arm_speed: float = 0.3
    """Speed at which the arm moves towards it [m/s]."""
    deceleration: float = 0.6
    """Deceleration with which the arm brakes [m/s^2]."""
    object_radius: float = 0.05
    """Radius of the approaching object [m]: a fist by default."""
    rate: float = 50.0
    """Readings of a unit a second [Hz]."""
    latency: float = 0.04
    """Time from a measurement to a motion [s]."""
    range: float = 1.3
    """Farthest target that fills a unit's cone [m]."""
    reflectance: float = 0.5
    """Reflectance of the approaching object at 940 nm."""
    way: float = 0.8
    """Length of the straight path on which it approaches [m]."""
    floor: float = -0.2
    """Height of the floor in the base frame [m]."""
    postures: int = 50
    """Number of postures."""
    seed: int = 0
    """Seed of the random postures and paths: the same seed gives the same numbers."""
    suggest: int = 0
    """Number of additional units to place where they help most."""
    sensor: str = "vl53l1x"
    """Type of sensor of additional units: vl53l1x, vl53l5cx, vl53l7cx, capacitive, or what the skin file describes."""
    out: str = ""
    """Skin file to write, with --suggest: the existing units and the new ones."""
    figure: str = ""
    """File for a figure of the arm, ending in .png, .pdf or .svg."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""
    replace: bool = False
    """Overwrite existing files."""

    def run(self) -> int:
        """Measure, show, and write the requested files."""
        from pretouch.cli.skin_coverage import skin_coverage

        skin_coverage(self)
        return 0


@dataclass(frozen=True)
class Monitor:
    """Watch sensor units: rates, losses, latency, batteries, and what is wrong, with what to do about it."""

    keys: str
    """File of the units' keys."""
    skin: str = ""
    """Skin file whose units to watch; by default all in the file of keys."""
    units: str = ""
    """Names of the units to watch, separated by commas."""
    arm: str = "panda"
    """The arm of the skin file: panda, fr3, or the folder of an imported arm."""
    posture: str = ""
    """Joint positions [rad], separated by commas, of the arm that stands still: with --skin, units whose readings
    contradict the model are named. Nothing but the arm may be near."""
    host: str = HOST
    """Address to listen at. Real units need 0.0.0.0, which is every address of this machine."""
    port: int = PORT
    """UDP port to listen at."""
    record: str = ""
    """Recording to write: all samples as received, ranges, IMU and diagnostics."""
    duration: float = 0.0
    """Time to watch [s]; 0: until Ctrl-C. The exit code is then 1 if a unit is faulty at the end."""
    once: bool = False
    """Watch for 5 s and print one table."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""

    def run(self) -> int:
        """Watch the units."""
        from pretouch.cli.skin_monitor import monitor

        return monitor(self)


@dataclass(frozen=True)
class Provision:
    """Set up a unit over USB: its number, its own random key, your Wi-Fi, and the receiver's address.

    The password is asked for, and shown nowhere.
    """

    id: str
    """Name of the unit, as in the skin file."""
    keys: str
    """File of the units' keys; created if it is missing, readable only by you."""
    ssid: str
    """Name of the Wi-Fi network (2.4 GHz)."""
    host: str
    """IPv4 address of this machine in that network."""
    number: int = 0
    """Number of the unit in datagrams, 1 to 65535; by default that in the file of keys, or the first free one."""
    device: str = "/dev/ttyUSB0"
    """Serial device of the unit."""
    port: int = PORT
    """UDP port of the receiver."""
    battery_full_mv: int = 0
    """Battery voltage at the full scale of the unit's converter [mV] (docs/how-to/wiring.md); 0: no battery."""
    sensor: str = "vl53l1x"
    """Range finder of the unit: vl53l1x, vl53l5cx or vl53l7cx (docs/how-to/flashing.md)."""
    zones: int = 4
    """Zones along each side of its range finder, 4 or 8, if it has some."""
    touch_ohm: int = 0
    """Resistor from the touch sensor's pin to ground [ohm] (docs/how-to/wiring.md); 0: no touch sensor."""
    touch_least_mn: int = 500
    """Smallest force that counts as a touch [mN]: `force_min_n` of the skin file."""
    touch_mn_per_us: int = 10
    """Force by the touch sensor's conductance [mN/uS], as calibrated."""
    password_file: str = ""
    """File whose first line is the Wi-Fi password, instead of typing it."""

    def run(self) -> int:
        """Set the unit up."""
        from pretouch.cli.skin_provision import provision_unit

        provision_unit(self)
        return 0


@dataclass(frozen=True)
class Keys:
    """List the units of a file of keys, add some with random keys to try `simulate` and `monitor`, or revoke keys."""

    keys: str
    """File of the units' keys; created if it is missing, readable only by you."""
    new: str = ""
    """Names of units to add, separated by commas."""
    revoke: str = ""
    """Names of units whose keys no longer count, separated by commas: lost or stolen. The others keep theirs."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""

    def run(self) -> int:
        """List the units, including added ones."""
        from pretouch.cli.skin_keys import keys_file, list_keys
        from pretouch.cli.writing import numbers_to

        with numbers_to(self.json) as write:
            write(list_keys(keys_file(self.keys), self.new, self.revoke))
        return 0


@dataclass(frozen=True)
class Simulate:
    """Simulate a skin that sends what real units send: an arm on its path, and a hand that comes and goes."""

    keys: str
    """File of the units' keys, created if it is missing. `pretouch skin monitor` needs the same file."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    host: str = HOST
    """Name or address of the receiver."""
    port: int = PORT
    """UDP port of the receiver."""
    loss: float = 0.0
    """Share of datagrams lost, in either direction."""
    loss_run: float = 0.0
    """Mean number lost in a row; 0: each is lost or not by itself."""
    delay: float = 0.008
    """Least time on the way to the receiver [s]."""
    jitter: float = 0.004
    """Mean of what is added to it at random [s]."""
    overtaken: float = 0.0
    """Share of datagrams held up so that later ones overtake them."""
    doubled: float = 0.0
    """Share of datagrams that arrive twice."""
    reboot_every: float = 0.0
    """Time between two reboots of each unit [s]; 0: none."""
    silenced: str = ""
    """Names of units that send nothing, separated by commas."""
    stuck: str = ""
    """Names of units whose range finder repeats its first reading, separated by commas."""
    hand: bool = True
    """Whether a person's hand comes and goes."""
    profile: str = "paper"
    """Profile of the arm's controller, or PROFILE:GROUP.FIELD=VALUE."""
    seed: int = 0
    """Decides all that is random."""
    duration: float = 0.0
    """Time to simulate [s]; 0: until Ctrl-C."""

    def run(self) -> int:
        """Simulate the units."""
        from pretouch.cli.skin_simulate import simulate_units

        simulate_units(self)
        return 0


@dataclass(frozen=True)
class Skin:
    """Sensor units: watch them, set them up, find where they sit, what they see in time, or simulate them."""

    what: (
        Annotated[Monitor, tyro.conf.subcommand("monitor")]
        | Annotated[Calibrate, tyro.conf.subcommand("calibrate")]
        | Annotated[Coverage, tyro.conf.subcommand("coverage")]
        | Annotated[Simulate, tyro.conf.subcommand("simulate")]
        | Annotated[Provision, tyro.conf.subcommand("provision")]
        | Annotated[Keys, tyro.conf.subcommand("keys")]
    )

    @staticmethod
    def of_words(words: Sequence[str]) -> tuple[Any, Sequence[str], str]:
        """Return the command, the words that are left, and those in front of them: a calibration may name an arm."""
        if words[:1] != ["calibrate"]:
            return Skin, words, "skin"
        name, others = split_arm(words[1:], "skin calibrate")
        if len(others) == len(words) - 1:
            return Skin, words, "skin"
        return CalibrateArm[arm_class(name)], others, f"skin calibrate {name}"  # type: ignore[misc]

    def run(self) -> int:
        """Run the command."""
        return self.what.run()
