"""Commands of the product that have no file of their own: their docstrings are the help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from pretouch.cli.words import words
from pretouch.hardware.udp import HOST, PORT


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

    def run(self) -> None:
        """Serve the page until interrupted."""
        from pretouch.cli.live import live

        live(self)


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

    def run(self) -> int:
        """Tell of the recording, and check, compare or show it."""
        from pretouch.cli.replay import replay

        return replay(Path(self.file), self.verify, self.profile, self.page, self.host, self.port)


@dataclass(frozen=True)
class Recover:
    """Make a recording that a killed process left behind open everywhere."""

    file: tyro.conf.Positional[str]
    """Recording; it stays as it is."""
    out: str = ""
    """File to write; by default NAME.recovered.mcap beside it."""

    def run(self) -> None:
        """Write the mended file."""
        from pretouch.cli.replay import recover

        recover(Path(self.file), Path(self.out) if self.out else None)


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

    def run(self) -> None:
        """Run the detectors, and show and write what they found."""
        from pretouch.cli.detect import detect
        from pretouch.foreign.source import Choice

        choice = Choice(self.wrench, self.joints, self.sign, self.frame, self.zeros, self.arm, ranges=bool(self.skin))
        skin, out, json = (Path(text) if text else None for text in (self.skin, self.out, self.json))
        detect(Path(self.file), choice, words(self.profiles), skin, self.rate, out, json)


@dataclass(frozen=True)
class Report:
    """Write what recordings tell as one page that needs no network: contacts, forces, distances, margins, health."""

    files: tyro.conf.Positional[tuple[str, ...]]
    """Recordings."""
    out: str = "report.html"
    """File to write."""
    limits: str = ""
    """TOML file with force limits of body regions, in place of those of ISO/TS 15066."""

    def run(self) -> None:
        """Write the page."""
        from pretouch.cli.report import write_page

        limits = Path(self.limits) if self.limits else None
        print(f"Report: {write_page([Path(file) for file in self.files], Path(self.out), limits)}")


@dataclass(frozen=True)
class WarmUp:
    """Compile a control step, once after an installation: what comes later then starts within a second."""

    def run(self) -> None:
        """Compile, and say where it is kept."""
        from pretouch.cli.warm_up import compile_step

        kept = compile_step()
        nowhere = "Compiled, but there is nowhere to keep it: HOME is not writable."
        print(f"Compiled, and kept in {kept}." if kept else nowhere)
