"""What can be said on the command line: one dataclass a command, its docstrings are the help."""

from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from pretouch.cli.bench_avoidance import Avoidance
from pretouch.cli.bench_both import Both
from pretouch.cli.bench_detection import Detection
from pretouch.cli.bench_localization import Localization
from pretouch.cli.identify import Identify
from pretouch.cli.robot_commands import Robot
from pretouch.cli.run.options import Run
from pretouch.cli.serve_fci_command import ServeFci
from pretouch.cli.skin_commands import Skin
from pretouch.cli.sweep import Sweep
from pretouch.hardware.address import HOST, PORT


@dataclass(frozen=True)
class Demo:
    """Play a small part of the paper's three experiments: blind, as the paper, and as we do it, side by side."""

    seeds: int = 4
    """Trials of each cell of the static experiment; the other two take one."""
    out: str = ""
    """Folder for results, figures and page; by default a new one under runs/."""


@dataclass(frozen=True)
class Reproduce:
    """Run the paper's experiments in full. A run that was stopped goes on where it was, with the same parameters."""

    experiment: tyro.conf.Positional[str] = "all"
    """static (paper IV-A), avoidance (IV-B), dynamic (IV-C), one of the studies of its claims and weaknesses, or all of
    them, which takes about an hour and a quarter on two processors."""
    seeds: int = 12
    """Trials of each cell; each seed is another arm with other errors, noise and geometry."""
    first_seed: int = 0
    """The first of them; only seed 0 is recorded and drawn unasked."""
    profiles: str = "blind,paper"
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter. With `all`,
    and where only the force estimate is studied, the studies have their own."""
    restrictions: str = ""
    """off, hard, slack or floor, or several of them; by default off in the static experiment and slack in others."""
    orientation: str = ""
    """free or hold: whether the task keeps the hand's orientation; by default the profile's own, hold."""
    stiffness: str = "25000"
    """Contact stiffness of the static object [N/m], or several, separated by commas."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    arm: str = ""
    """Folder of an arm that `pretouch robot import` wrote, for the static experiment; by default the Panda. The paper's
    paths are scaled and moved into its reach, and the skin is the folder's own."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, of which each trial's seed
    draws its own; by default the usual ones."""
    record: str = "first"
    """first: record the trials of the first seed of which figures are drawn; all: record every trial."""
    out: str = ""
    """Folder for results, recordings, figures and page; by default runs/reproduce-EXPERIMENT."""
    json: str = ""
    """File for all trials and their summary; by default results.json in the folder."""


@dataclass(frozen=True)
class Figure:
    """Draw one figure of the paper, from a run that is there or from trials played for it."""

    name: tyro.conf.Positional[str]
    """circle (Fig. 4), interaction (Fig. 5), close-up (Fig. 6), force-difference (Fig. 7) or framework (Fig. 2)."""
    run: str = ""
    """Folder of a run of `reproduce` or `demo` to draw it from; by default what is needed is played first."""
    out: str = ""
    """File to write, ending in .png, .pdf or .svg; by default NAME.png."""
    profile: str = "paper"
    """Profile that is shown."""
    seed: int = 0
    """Seed of the trials that are played; runs keep the course of seed 0."""


@dataclass(frozen=True)
class FreeMotion:
    """How far the force estimate of an arm left alone is off, and which detectors take that for a contact."""

    seeds: int = 10
    """Simulated arms; each is left alone for twenty minutes, a quarter of them standing."""
    out: str = ""
    """Folder for results, figures and page; by default runs/bench-free-motion."""
    json: str = ""
    """File for all trials and their summary; by default results.json in the folder."""


@dataclass(frozen=True)
class Cycle:
    """How long a control step takes: processor and wall time at a rate, overruns, and the share of each stage."""

    points: str = "7,32,128,1000"
    """Numbers of sensed points, separated by commas, each shown by a unit 50 times a second."""
    rate: float = 1000.0
    """Cycles a second; everything the profile counts in cycles is brought to it."""
    cycles: int = 20_000
    """Steps measured for each number of points."""
    profile: str = "paper"
    """Profile of the controller, or PROFILE:GROUP.FIELD=VALUE."""
    json: str = ""
    """File for the numbers; by default they are only shown."""
    priority: int | None = None
    """Real-time priority, 1 to 99 (80 is usual); by default the process keeps its own."""
    cpu: int | None = None
    """Number of the processor to stay on; by default the system decides."""


@dataclass(frozen=True)
class Bench:
    """Measure something: detectors, ways to avoid people, places of contacts, force estimates, or a step's time."""

    what: (
        Annotated[Detection, tyro.conf.subcommand("detection")]
        | Annotated[Avoidance, tyro.conf.subcommand("avoidance")]
        | Annotated[Localization, tyro.conf.subcommand("localization")]
        | Annotated[Both, tyro.conf.subcommand("both")]
        | Annotated[FreeMotion, tyro.conf.subcommand("free-motion")]
        | Annotated[Cycle, tyro.conf.subcommand("cycle")]
    )


@dataclass(frozen=True)
class WarmUp:
    """Compile a control step, once after an installation: what comes later then starts within a second."""


@dataclass(frozen=True)
class Live:
    """Watch the simulated arm in a browser and touch it: a page with the arm, your hand, plots and all parameters."""

    profile: str = "pretouch"
    """Profile to begin with, or PROFILE:GROUP.FIELD=VALUE."""
    path: str = "circle"
    """circle or line."""
    seed: int = 0
    """Simulated arm to take: each has other errors and noise."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, as `pretouch identify`
    writes one, of which the seed draws its own; by default the usual ones."""
    record: str = ""
    """Recording to write from the start; the page can begin and end recordings too."""
    host: str = "127.0.0.1"
    """Address to serve the page at. Anyone who can reach it can move the simulated arm."""
    port: int = 8080
    """Port to serve the page at."""
    keys: str = ""
    """File of the keys of real sensor units, which the simulated arm then carries in place of simulated ones."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    units_host: str = HOST
    """Address at which real units are heard. They need 0.0.0.0, which is every address of this machine."""
    units_port: int = PORT
    """UDP port at which real units are heard."""


@dataclass(frozen=True)
class Replay:
    """Look at a recording on the page, recompute it, or see what another profile would have felt."""

    file: tyro.conf.Positional[str]
    """Recording; one of a killed process as well."""
    verify: bool = False
    """Recompute every step, and report the first that came out otherwise; the exit code is then 1. Opens no page."""
    profile: str = ""
    """Profile whose decisions on the same force and range data are shown beside the recorded ones."""
    page: bool = True
    """Whether to open the page; --no-page only prints."""
    host: str = "127.0.0.1"
    """Address to serve the page at."""
    port: int = 8080
    """Port to serve the page at."""


@dataclass(frozen=True)
class Recover:
    """Make a recording that a killed process left behind open everywhere."""

    file: tyro.conf.Positional[str]
    """Recording; it stays as it is."""
    out: str = ""
    """File to write; by default NAME.recovered.mcap beside it."""


@dataclass(frozen=True)
class Detect:
    """Try the contact thresholds on a recording of your own arm: a ROS bag, an MCAP file, or a CSV file."""

    file: tyro.conf.Positional[str]
    """ROS 2 bag (folder, .mcap, .db3), ROS 1 .bag, or .csv with columns time_s, force_x_N, force_y_N, force_z_N."""
    profiles: str = "paper"
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter."""
    # the choices of pretouch.foreign.source, spelt out: the help is to need none of the heavy packages
    sign: Literal["on-robot", "by-robot"] = "on-robot"
    """Whose force it is: on the robot by its environment, or by the robot, as Franka's O_F_ext_hat_K."""
    frame: Literal["base", "ee"] = "base"
    """Frame the force is given in; ee, the end-effector's, needs joint positions of a Panda or FR3."""
    zeros: Literal["auto", "missing", "kept"] = "auto"
    """Whether six zeros mean that there is no estimate; auto: with --sign by-robot."""
    wrench: str = ""
    """Topic of the force, if there are several."""
    joints: str = ""
    """Topic of the joint positions, if there are several."""
    arm: Literal["auto", "panda", "fr3"] = "auto"
    """The arm; auto: what its joints' names say, or else a Panda."""
    skin: str = ""
    """Skin file, to use the recording's ranges; by default only the force is used."""
    rate: float = 0.0
    """Rate of the detector [Hz]; by default the profile's own, 100."""
    out: str = ""
    """Figure to write, ending in .png, .pdf or .svg."""
    json: str = ""
    """File for the numbers."""


@dataclass(frozen=True)
class Report:
    """Write what recordings tell as one page that needs no network: contacts, forces, distances, margins, health."""

    files: tyro.conf.Positional[tuple[str, ...]]
    """Recordings."""
    out: str = "report.html"
    """File to write."""
    limits: str = ""
    """TOML file with force limits of body regions, in place of those of ISO/TS 15066."""


Command = (
    Annotated[Demo, tyro.conf.subcommand("demo")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Figure, tyro.conf.subcommand("figure")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[Sweep, tyro.conf.subcommand("sweep")]
    | Annotated[Live, tyro.conf.subcommand("live")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Recover, tyro.conf.subcommand("recover")]
    | Annotated[Detect, tyro.conf.subcommand("detect")]
    | Annotated[Identify, tyro.conf.subcommand("identify")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[Skin, tyro.conf.subcommand("skin")]
    | Annotated[WarmUp, tyro.conf.subcommand("warm-up")]
    | Annotated[Robot, tyro.conf.subcommand("robot")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[ServeFci, tyro.conf.subcommand("serve-fci")]
)
