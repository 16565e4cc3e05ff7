"""The scaling report as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from ensemble.mpi.scaling_model import LEAST_EFFICIENCY, ScalingModel
from ensemble.report.markdown_table import bullets, image_links, table
from ensemble.report.scaling.scaling_document import Scaling

_EVALUATION = {
    "vesicles": "vesicles",
    "ranks": "ranks",
    "seconds": "seconds",
    "efficiency": "efficiency",
    "seconds by the model": "predicted",
    "kernels": "kernels",
    "collectives": "collectives",
    "solves": "solves",
    "other": "other",
    "gathers": "gathers",
    "bytes gathered": "gathered_bytes",
    "difference from one rank": "difference",
}
_WEAK = {"vesicles": "vesicles", "ranks": "ranks", "seconds": "seconds", "efficiency": "efficiency"}
_COLLECTIVE = {"ranks": "ranks", "bytes": "gathered_bytes", "seconds": "seconds"}
_COST = {
    "vesicles": "vesicles",
    "seconds": "seconds",
    "sums over all points": "sums",
    "peak memory (bytes)": "peak_memory_bytes",
    "seconds a vesicle": "seconds_a_vesicle",
}
_GROUPS = {
    "groups": "groups",
    "points": "points",
    "seconds a run": "run_seconds",
    "runs": "runs",
    "seconds": "wall_seconds",
    "busy": "busy",
    "dispatcher's share of rank 0": "dispatcher_share",
    "its seconds a run": "dispatcher_seconds_a_run",
}
_PREDICTION = {"vesicles": "vesicles", "ranks": "ranks", "efficiency": "efficiency"}


def scaling_conclusions(report: Scaling) -> list[str]:
    """Return what the report comes to.

    Parameters
    ----------
    report : Scaling
        The report as data.

    Returns
    -------
    list of str
        A sentence each.
    """
    most = max(report.evaluations, key=lambda row: (row.vesicles, row.ranks))
    largest = report.costs[-1]
    worth = ", ".join(f"{row.ranks} for {row.vesicles} vesicles" for row in report.recommendations[-3:])
    return [
        f"{most.vesicles} vesicles: {most.seconds:.2g} s an evaluation on {most.ranks} ranks, an efficiency "
        f"of {most.efficiency:.0%}.",
        f"Ranks that are worth it (the model is {LEAST_EFFICIENCY:.0%} efficient): {worth}.",
        f"{largest.vesicles} vesicles on one rank: {largest.seconds_a_vesicle:.2g} s an evaluation for each.",
        f"The model's largest deviation from a measured time is {report.largest_misprediction:.0%}.",
        *(
            f"{row.groups} groups with runs of {row.run_seconds:.2g} s, simulated: {row.busy:.0%} busy, "
            f"while the dispatcher takes {row.dispatcher_share:.1%} of rank 0."
            for row in report.groups[-1:]
        ),
        *(["There are more ranks than cores, so the times mean nothing."] if report.oversubscribed else []),
    ]


def scaling_text(report: Scaling, figures: Sequence[str]) -> str:
    """Return the report as Markdown.

    Parameters
    ----------
    report : Scaling
        The report as data.
    figures : sequence of str
        Names of the image files to show.

    Returns
    -------
    str
        The text.
    """
    model = report.model
    sections = [
        "# Scaling",
        bullets(scaling_conclusions(report)),
        f"Made on: {report.machine.sentence()}; {report.ranks} ranks, one thread each.  "
        f"Evaluations of the right-hand side, {report.points} points on each vesicle: adhering vesicles in "
        "shear, at random places in a square of which they fill a fifth (2: the published pair, of which one "
        "is computed).  Each time is the least of several; compilation is not timed.",
        *image_links(figures),
        "## Strong scaling",
        "Shares of the time are those of the first rank, profiled; waiting for others counts as collectives.",
        table(_EVALUATION, report.evaluations),
        "## Weak scaling",
        "As many vesicles on each rank.",
        table(_WEAK, report.weak),
        "## Collectives",
        f"Allgatherv; latency {model.latency:.2g} s, bandwidth {model.bandwidth:.2g} bytes/s.",
        table(_COLLECTIVE, report.collectives),
        "## Model",
        "t(G) = (level·P·log₂ P + point·P)/G + repeated·P + fixed + gathers·(latency·⌈log₂ G⌉ + "
        f"bytes·P·(G − 1)/(G·bandwidth)) for P points on G ranks, with {_constants(model)}.  Its "
        f"largest deviation from a measured time is {report.largest_misprediction:.0%}.  Latency and "
        "bandwidth are those of this machine; a network's are others.",
        table(_PREDICTION, report.predictions),
        "## Ranks for a run",
        f"The most ranks, up to 10,000, on which the model is {LEAST_EFFICIENCY:.0%} efficient.",
        table({"vesicles": "vesicles", "ranks": "ranks"}, report.recommendations),
        "## Cost against the number of vesicles",
        "On one rank, and the memory of the process.",
        table(_COST, report.costs),
        "## Many groups of ranks",
        *_groups(report),
    ]
    return "\n\n".join(sections) + "\n"


def _groups(report: Scaling) -> list[str]:
    if not report.groups:
        return [
            "The store has too few runs to take their times from; `ensemble bisect` makes them, and then "
            "this report says how busy thousands of groups are."
        ]
    return [
        "A boundary in simulated time.  The dispatcher is the real one, and its work passes as it takes; "
        "messages and commits take what was measured here; simulations take as long as runs in the store, or "
        "a hundred times as long.",
        table(_GROUPS, report.groups),
    ]


def _constants(model: ScalingModel) -> str:
    """Return the constants of computed times, and how often and how much is exchanged."""
    seconds = {name: getattr(model, name) for name in ("level", "point", "repeated", "fixed")}
    each = [f"{name} = {value:.3g} s" for name, value in seconds.items()]
    return ", ".join([*each, f"gathers = {model.gathers:.3g}", f"bytes = {model.bytes_a_point:.3g}"])
