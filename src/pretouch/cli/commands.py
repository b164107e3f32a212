"""Commands of the product that have no file of their own: their docstrings are the help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from pretouch.cli.words import words
from pretouch.hardware.address import HOST, PORT


@dataclass(frozen=True)
class Live:
    """Watch the simulated arm in a browser and touch it: a page with the arm, your hand, plots and all parameters."""

    profile: str = "pretouch"
    """Profile to start with, or PROFILE:GROUP.FIELD=VALUE."""
    arm: str = "panda"
    """panda, fr3, a name that another package adds, or the folder of an imported arm, to which the room is scaled."""
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
        """Describe the recording, and check, compare or show it."""
        from pretouch.cli.replay import replay

        return replay(Path(self.file), self.verify, self.profile, self.page, self.host, self.port, self.json)


@dataclass(frozen=True)
class Detect:
    """Detect contacts in a recording of your own arm: a ROS bag, an MCAP file, a CSV or a Parquet file."""

    file: tyro.conf.Positional[str]
    """ROS 2 bag (folder, .mcap, .db3), ROS 1 .bag, or .csv or .parquet with columns time_s, q1_rad ..., dq1_rad_s ...
    and tau_ext1_Nm ... (or tau1_Nm ..., current1_A ...), or force_x_N, force_y_N, force_z_N; or a log of libfranka."""
    profiles: str = "auto"
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter. auto:
    pretouch,paper where there are joint torques, else paper."""
    # the choices of pretouch.imported_data.source, spelt out: the help is to need none of the heavy packages
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
    skin: str = ""
    """Skin file, to use the recording's ranges; by default only the force is used."""
    rate: float = 0.0
    """Rate of the detector [Hz]; by default the profile's own, 100."""
    out: str = ""
    """Figure to write, ending in .png, .pdf or .svg, or page, ending in .html."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""

    def run(self) -> None:
        """Run the detectors, and show and write what they found."""
        from pretouch.cli.detect import detect, gains_of
        from pretouch.imported_data.renaming import mapping_of
        from pretouch.imported_data.source import Choice

        choice = Choice(
            self.wrench, self.joints, self.sign, self.frame, self.zeros, self.arm, bool(self.skin), self.torques,
            mapping_of(self.columns), gains_of(self.gains), self.payload,
        )  # fmt: skip
        skin, out, json = (Path(text) if text else None for text in (self.skin, self.out, self.json))
        profiles = None if self.profiles == "auto" else words(self.profiles)
        detect(Path(self.file), choice, profiles, skin, self.rate, out, json)


@dataclass(frozen=True)
class Report:
    """Write a report of recordings as one page that needs no network: contacts, forces, distances, margins, health."""

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
    """Compile a control step, once after an installation: later commands then start within a second."""

    def run(self) -> None:
        """Compile, and print where it is cached."""
        from pretouch.cli.warm_up import compile_step

        print("Compiling what all profiles need: two to four minutes the first time ...", flush=True)
        kept = compile_step()
        nowhere = "Compiled, but not cached: HOME is not writable."
        print(f"Compiled, and cached in {kept}." if kept else nowhere)


@dataclass(frozen=True)
class ServeFci:
    """Serve a simulated Panda or FR3 to programs that use the vendor's library, as the robot itself would be."""

    robot: Literal["panda", "fr3"] = "panda"
    """The robot: panda speaks protocol 5 (libfranka 0.9), fr3 protocol 10 (libfranka 0.18 and later)."""
    host: str = "127.0.0.1"
    """Address to serve at. Anyone who can reach it can move the simulated arm."""
    port: int = 1337
    """TCP port; the vendor's library supports no other. The gripper has the next. 0 lets the system choose both."""
    lockstep: bool = False
    """Send each state only after the command for the last one: repeatable, and faster than real time."""
    patience: float = 60.0
    """In lockstep, a command that has not arrived after this time is lost [s]."""
    grace: float = 0.01
    """In real time, extra time beyond its millisecond to wait for a command [s]: this machine may be slow. 0 is as
    strict as the robot."""
    scene: Literal["empty", "static", "dynamic"] | Path = "empty"
    """Surroundings: nothing, the board of the static experiment, the person of the dynamic one, or a world of your own
    from an MJCF file, in which the arm stands at the site `base`, or else at the origin."""
    trajectory: Literal["circle", "line"] = "circle"
    """Path of the static experiment, beside which its board stands."""
    side: Literal["+y", "-y"] = "+y"
    """Side of the board."""
    stiffness: float = 25_000.0
    """Contact stiffness of board and boxes [N/m], greater than 0."""
    box: tuple[str, ...] = ()
    """Boxes in the empty scene, each X,Y,Z:DX,DY,DZ: centre and edges [m], base frame."""
    start: str = "ready"
    """Initial posture of the arm: ready, its usual one, path, that at the start of the path, or seven joint angles
    between commas [rad]."""
    seed: int = 0
    """Seed of the simulated arm and scene: each arm has different errors and noise, each scene different positions."""
    push: tuple[str, ...] = ()
    """Forces on the arm at its TCP, each T:FX,FY,FZ or T:FX,FY,FZ:DURATION [s, N, s], base frame, up to
    1000 N. T counts from the start of the server; in lockstep, from the first motion on, while the arm moves."""
    hand: bool = False
    """Let a person's hand come and go before the arm, in the empty scene."""
    object: str = ""
    """What lies between the fingers of the gripper, WIDTH:KG, such as 0.04:0.5 [m, kg]; by default nothing."""
    units: str = ""
    """HOST:PORT of the receiver of the arm's sensor units; by default they are switched off."""
    keys: str = ""
    """File of the keys of the units, the same as the receiver's."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    stdin: bool = False
    """Take what a person would type, such as 0.5:0,15,0:0.2 (0.5 s from now), from the standard input though it is no
    terminal, and end with it."""
    truth: str = ""
    """CSV file for the ground truth: true force on the arm and joint positions, each millisecond."""
    drop: str = ""
    """Commands to lose, such as 3/50: the first 3 of every 50."""
    once: bool = False
    """End when the first client has disconnected."""

    def run(self) -> None:
        """Serve until interrupted."""
        from pretouch.cli.serve_fci import serve_fci

        serve_fci(self)
