"""All experiments by name, and what is made of the trials of several."""

from typing import Any

from pretouch.errors import ExperimentError
from pretouch.text_table import TextTable
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper import avoidance, dynamic, static
from pretouch_lab.paper.claims import anticipation, between, detectable, free_motion, noise
from pretouch_lab.rows import Row
from pretouch_lab.studies import clamp, mounting, pinch, tactile, two_arms, vision, wire
from pretouch_lab.studies.coverage import study as coverage
from pretouch_lab.weaknesses import (
    creeping,
    dropout,
    endless,
    infeasible,
    release,
    retreating,
    tuned,
    views,
)

PAPER = (static.EXPERIMENT, avoidance.EXPERIMENT, dynamic.EXPERIMENT)
CLAIMS = (
    between.EXPERIMENT,
    anticipation.EXPERIMENT,
    free_motion.EXPERIMENT,
    noise.EXPERIMENT,
    detectable.EXPERIMENT,
)
WEAKNESSES = (
    tuned.EXPERIMENT,
    release.EXPERIMENT,
    endless.EXPERIMENT,
    dropout.EXPERIMENT,
    creeping.EXPERIMENT,
    retreating.EXPERIMENT,
    views.EXPERIMENT,
    infeasible.EXPERIMENT,
)
HARDWARE = (wire.EXPERIMENT,)
MOUNTING = (mounting.EXPERIMENT, coverage.EXPERIMENT)
REACTION = (clamp.EXPERIMENT, pinch.EXPERIMENT)
TOUCH = (tactile.EXPERIMENT,)
VISION = (vision.EXPERIMENT,)
TWO_ARMS = (two_arms.EXPERIMENT,)

GROUPS = {
    "The paper's experiments": PAPER,
    "What the paper says of its method": CLAIMS,
    "Its weaknesses": WEAKNESSES,
    "Readings over the wire": HARDWARE,
    "Where units sit": MOUNTING,
    "Clamped between two objects": REACTION,
    "Touch sensors of units": TOUCH,
    "A camera beside the skin": VISION,
    "Two arms over one table": TWO_ARMS,
}
"""All experiments by what they are for, in the order of the page."""
EXPERIMENTS: dict[str, Experiment] = {e.name: e for group in GROUPS.values() for e in group}


def summarise(trials: list[Row]) -> dict[str, Any]:
    """Summaries of the experiments in a list of trials, by name. Trials of another form are an ExperimentError."""
    found = {}
    for name, experiment in EXPERIMENTS.items():
        rows = [trial for trial in trials if trial.get("experiment") == name]
        try:
            if rows:
                found[name] = experiment.summarise(rows)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise ExperimentError(
                f"A file of a trial of {name} was changed ({type(error).__name__}: {error}): delete trials/{name}-* in"
                " the folder of the run, and give the same command again."
            ) from error
    return found


def conclusions(summary: dict[str, Any]) -> list[str]:
    """What came out of the experiments that say so."""
    told = (experiment.conclude(summary[name]) for name, experiment in EXPERIMENTS.items() if name in summary)
    return [said for said in told if said]


def tables(summary: dict[str, Any]) -> list[TextTable]:
    """All tables of such summaries."""
    return [
        table
        for name, experiment in EXPERIMENTS.items()
        if name in summary
        for table in experiment.tables(summary[name])
    ]
