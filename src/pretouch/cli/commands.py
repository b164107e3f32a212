"""Commands of the product that have no file of their own: their docstrings are the help."""

import sys
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import tyro

from pretouch.cli.words import words
from pretouch.units.udp import HOST, PORT


@dataclass(frozen=True)
class Live:
    """Watch the simulated arm in a browser and touch it: a page with the arm, your hand, plots and all parameters."""

    profile: str = "pretouch"
    """Profile to start with, or PROFILE:GROUP.FIELD=VALUE."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm, to which the room is scaled."""
    path: str = "circle"
    """circle or line."""
    seed: int = 0
    """Seed of the simulated arm: each has different errors and noise."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, as `pretouch identify`
    writes one, of which the seed draws its own; by default the usual ones."""
    record: str = ""
    """Recording to write from the start; the page can also start and stop recordings."""
    host: str = "127.0.0.1"
    """Address to serve the page at. Beyond this machine, whoever has the printed address can move the simulated arm."""
    port: int = 8080
    """Port to serve the page at."""
    keys: str = ""
    """File of the keys of real sensor units, which the simulated arm then carries in place of simulated ones."""
    skin: str = ""
    """Skin file; by default 34 units all over hand, wrist, forearm and elbow, and with --keys the seven of other
    commands; of an imported arm the skin in its folder."""
    opening: bool = True
    """Whether a hand comes by itself at first, until somebody drags or clicks; never with --keys or --record."""
    units_host: str = HOST
    """Address to receive real units at. They need 0.0.0.0, which is every address of this machine."""
    units_port: int = PORT
    """UDP port to receive real units at."""

    def run(self) -> None:
        """Serve the page until interrupted."""
        from pretouch.cli.live import live

        live(self)


@dataclass(frozen=True)
class Replay:
    """View a recording on the page, recompute it, or compare it with what another profile would have detected."""

    file: tyro.conf.Positional[str]
    """Recording; that of a killed process works too."""
    verify: bool = False
    """Recompute every step, and report the first that differs; the exit code is then 1. Opens no page."""
    profile: str = ""
    """Profile whose decisions on the same force and range data are shown beside the recorded ones."""
    page: bool = True
    """Whether to open the page; --no-page only prints."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""
    host: str = "127.0.0.1"
    """Address to serve the page at. Beyond this machine, whoever has the printed address sees the recording."""
    port: int = 8080
    """Port to serve the page at."""

    def run(self) -> int:
        """Describe the recording, and check, compare or show it; where the page is, is said before anything is read."""
        from pretouch.page.server import ServeOptions, begun, browser_here

        place, page = Path(self.file), None
        with ExitStack() as stack:
            if self.page and not self.verify and place.is_file():
                options = ServeOptions(self.host, self.port, browser_here())
                say = partial(print, file=sys.stderr if self.json == "-" else None, flush=True)
                named = place.name, "The recording", "see the recording, and play it"
                page = stack.enter_context(begun(options, *named, say))
            from pretouch.cli.replay import replay

            return replay(place, self.verify, self.profile, page, self.json)


@dataclass(frozen=True)
class Detect:
    """Detect contacts in a recording of your own arm: a ROS bag, an MCAP file, a CSV or a Parquet file."""

    file: tyro.conf.Positional[str]
    """ROS 2 bag (folder, .mcap, .db3), ROS 1 .bag, or .csv or .parquet with columns time_s, q1_rad ..., dq1_rad_s ...
    and tau_ext1_Nm ... (or tau1_Nm ..., current1_A ...), or force_x_N, force_y_N, force_z_N; or a log of libfranka."""
    profiles: str = "auto"
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter. auto:
    pretouch,paper where there are joint torques, else paper."""
    # the choices of pretouch.imported_data.log, spelt out: the help is to need none of the heavy packages
    sign: Literal["auto", "on-robot", "by-robot"] = "auto"
    """Whether force and external torques are on the robot (by its environment) or by the robot, as Franka's
    O_F_ext_hat_K; auto: on the robot, but for torques by the name tau_ext_hat_filtered."""
    frame: Literal["base", "ee"] = "base"
    """Frame of the force; ee, the end-effector's, needs joint positions of a Panda or FR3."""
    zeros: Literal["auto", "missing", "kept"] = "auto"
    """Whether six zeros mean no estimate; auto: yes with --sign by-robot."""
    wrench: str = ""
    """Topic of the force, if there are several."""
    joints: str = ""
    """Topic of the joint positions, if there are several."""
    torques: str = ""
    """Topic of the joint torques: JointState with efforts, FrankaState or FrankaRobotState; by default what is
    found."""
    arm: str = "auto"
    """The arm: panda, fr3, or the folder of `pretouch robot import`; auto: by the names of its joints, otherwise a
    Panda."""
    columns: str = ""
    """Columns of other names, THEIRS=OURS separated by commas, or FILE.toml: tau_J_0=tau1_Nm; tau_J_*=tau*_Nm is all
    joints."""
    gains: str = ""
    """Torque by motor current of each joint, gear included [Nm/A], separated by commas: for current1_A."""
    payload: float = 0.0
    """Load at the end-effector that the arm's model does not have [kg]: for measured torques."""
    rate: float = 0.0
    """Rate of the detector [Hz]; by default the profile's own, 100."""
    out: str = ""
    """Figure to write, ending in .png, .pdf or .svg, or page, ending in .html."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""

    def run(self) -> None:
        """Run the detectors, and show and write what they found."""
        from pretouch.cli.detect import detect, gains_of
        from pretouch.imported_data.log import Choice
        from pretouch.imported_data.renaming import mapping_of

        choice = Choice(
            self.wrench, self.joints, self.sign, self.frame, self.zeros, self.arm, self.torques,
            mapping_of(self.columns), gains_of(self.gains), self.payload,
        )  # fmt: skip
        out, json = (Path(text) if text else None for text in (self.out, self.json))
        profiles = None if self.profiles == "auto" else words(self.profiles)
        detect(Path(self.file), choice, profiles, self.rate, out, json)


@dataclass(frozen=True)
class Report:
    """Write a report of recordings as one page that needs no network: contacts, forces, distances, margins, health."""

    files: tyro.conf.Positional[tuple[str, ...]]
    """Recordings."""
    out: str = "report.html"
    """File to write."""
    replace: bool = False
    """Overwrite a file that is there though it is no report of these recordings."""

    def run(self) -> None:
        """Write the page."""
        from pretouch.cli.report import write_page

        print(f"Report: {write_page([Path(file) for file in self.files], Path(self.out), self.replace)}")


@dataclass(frozen=True)
class WarmUp:
    """Compile a control step, once after an installation: later commands then start within a second."""

    def run(self) -> None:
        """Compile, and print where it is cached."""
        from pretouch.cli.warm_up import compile_step

        print("Compiling what all profiles need: about a minute the first time ...", flush=True)
        place = compile_step()
        print(f"Compiled, and cached in {place}." if place else "Compiled, but not cached: HOME is not writable.")
