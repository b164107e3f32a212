"""`pretouch learn`: its docstrings are the help."""

from dataclasses import dataclass


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
