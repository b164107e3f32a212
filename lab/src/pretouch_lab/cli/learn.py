"""`pretouch learn` and `policy`: their docstrings are the help."""

from dataclasses import dataclass

import tyro


@dataclass(frozen=True)
class Learn:
    """Train a policy to reach among people, alone and under the shield, and hold both against each other.

    About fifty minutes on two processors, with --quick three. A run that was stopped goes on with the same --out.
    """

    quick: bool = False
    """A few minutes of training, too few to learn much."""
    steps: int = 0
    """Steps of each of the two trainings, of 0.05 s; by default 300 000, with --quick 12 288."""
    out: str = ""
    """Folder for policies and results; by default runs/learn, with -quick if it is."""
    json: str = ""
    """File for the numbers; by default results.json in the folder. -: also to standard output, and text to standard
    error."""

    def run(self) -> None:
        """Train and play what is missing, with a table and numbers."""
        from pretouch.errors import ParameterError
        from pretouch_lab.cli.benchmarks import BenchOptions, run_bench
        from pretouch_lab.learning import LEARN
        from pretouch_lab.learning.bench import LearningBench

        LEARN.need("Training")
        if self.steps < 0:
            raise ParameterError(f"The number of steps is {self.steps}: give more than 0.")
        options = BenchOptions(self.quick, out=self.out)
        run_bench(LearningBench(options.folder("learn"), self.quick, steps=self.steps), options, self.json)


@dataclass(frozen=True)
class Policy:
    """Watch a policy that `pretouch learn` trained drive the simulated arm of the live page, and come into its way."""

    file: tyro.conf.Positional[str]
    """File of the policy."""
    profile: str = "pretouch"
    """Profile of the controller it drives through; the page can change its parameters."""
    seed: int = 0
    """Seed of the simulated arm, and of the places it goes to."""
    port: int = 8080
    """Port to serve the page at, on this machine alone."""

    def run(self) -> None:
        """Serve the page until interrupted."""
        from functools import partial
        from pathlib import Path

        from pretouch.extras import LIVE
        from pretouch.profiles import profile
        from pretouch.signals import ended
        from pretouch.viewer.live import serve_live
        from pretouch.viewer.room import LiveSettings
        from pretouch.viewer.server import ServeOptions, browser_here, check_port
        from pretouch.viewer.simulation import LiveSimulation
        from pretouch_lab.learning.live import PolicyCommander
        from pretouch_lab.learning.policy import load_policy

        LIVE.need("The page")
        options, policy = ServeOptions(port=self.port, opened=browser_here()), load_policy(Path(self.file))
        check_port(options)
        simulation = LiveSimulation(LiveSettings(profile=profile(self.profile), seed=self.seed))
        simulation.commander = PolicyCommander(policy, simulation, self.seed)
        serve_live(simulation, options, ended, partial(print, flush=True))
