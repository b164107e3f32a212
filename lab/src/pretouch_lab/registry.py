"""All experiments by name, and what is made of the trials of several."""

from typing import Any

from pretouch.text_table import TextTable
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper import avoidance, dynamic, static
from pretouch_lab.paper.claims import between
from pretouch_lab.rows import Row
from pretouch_lab.studies import mounting, two_arms
from pretouch_lab.studies.coverage import study as coverage

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        static.EXPERIMENT,
        avoidance.EXPERIMENT,
        dynamic.EXPERIMENT,
        between.EXPERIMENT,
        mounting.EXPERIMENT,
        coverage.EXPERIMENT,
        two_arms.EXPERIMENT,
    )
}
"""All experiments by name, in the order of their tables."""


def summarise(trials: list[Row]) -> dict[str, Any]:
    """Summaries of the experiments in a list of trials, by name."""
    rows = {name: [trial for trial in trials if trial["experiment"] == name] for name in EXPERIMENTS}
    return {name: experiment.summarise(rows[name]) for name, experiment in EXPERIMENTS.items() if rows[name]}


def tables(summary: dict[str, Any]) -> list[TextTable]:
    """All tables of such summaries."""
    return [
        table
        for name, experiment in EXPERIMENTS.items()
        if name in summary
        for table in experiment.tables(summary[name])
    ]
