"""One run that goes on from its checkpoint, keeps one, and can be stopped after any of its steps."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import Enum, auto
from typing import TYPE_CHECKING

from ensemble.config.checkpoint_interval import checkpoint_seconds
from ensemble.errors import StoreError
from ensemble.mpi.world import tell
from solver.simulation.simulate import Simulation

if TYPE_CHECKING:
    from ensemble.store.checkpoint import Checkpoint
    from solver.analysis.record import Sink
    from solver.analysis.run import RunResults
    from solver.memory import Saved
    from solver.parallel import Parallel
    from solver.scene import Scene

_LOOK_SECONDS = 0.02  # between two looks at whether the run is to be stopped
_LARGEST_SHARE = 0.01  # of the wall time that checkpoints take


class Order(Enum):
    """What becomes of a run after a step."""

    GO_ON = auto()
    KEEP = auto()  # a checkpoint is due
    SUSPEND = auto()
    CANCEL = auto()


class Stopped(Exception):  # noqa: N818  somebody wants it, so it is no error
    """The run has been stopped after a step."""


class CheckpointKeeper:
    """Decides, on the first rank of a run, when a checkpoint is due, and writes it.

    Parameters
    ----------
    checkpoint : Checkpoint
        Of the run.
    order : callable
        Returns whether the run goes on or is to be suspended or canceled; called every few steps.

    Attributes
    ----------
    key : str
        Of the run.
    record : RecordedBlocks
        Takes what the run records.
    """

    def __init__(self, checkpoint: Checkpoint, order: Callable[[], Order]) -> None:
        self.key, self.record = checkpoint.key, checkpoint.record
        self._checkpoint = checkpoint
        self._order = order
        self._interval = checkpoint_seconds()
        self._next_look = 0.0
        self._next_checkpoint = time.monotonic() + self._interval
        self._trouble: str | None = None
        self._was_kept = False  # before this command

    def read(self) -> Saved | None:
        """Return the state to go on from; None, with a line that says why, if there is none of use."""
        try:
            saved = self._checkpoint.read()
        except StoreError as error:
            self.begin_anew(str(error))
            return None
        self._was_kept = saved is not None
        return saved

    def begin_anew(self, reason: str) -> None:
        """Say why the run does not go on from its checkpoint.

        Parameters
        ----------
        reason : str
        """
        tell(f"run {self.key} begins anew, its checkpoint cannot be used: {reason}")

    def order(self) -> Order:
        """Return what becomes of the run after the step that it has just taken."""
        now = time.monotonic()
        if now < self._next_look:
            return Order.GO_ON
        self._next_look = now + _LOOK_SECONDS
        order = self._order()
        if order is Order.GO_ON and now >= self._next_checkpoint:
            return Order.KEEP
        if order is Order.CANCEL:
            if self._was_kept:  # that of another command is not this one's to drop
                self._checkpoint.leave()
            else:
                self._checkpoint.remove()
        return order

    def write(self, saved: Saved, began: float) -> None:
        """Write a checkpoint; a run goes on without one that the disk does not take.

        Parameters
        ----------
        saved : dict
            As `Simulation.saved` returns it.
        began : float
            When it was begun to be collected, on the monotonic clock.
        """
        trouble = None
        try:
            self._checkpoint.write(saved)
        except OSError as error:
            trouble = f"run {self.key}: its checkpoint cannot be written ({error})"
        if trouble and trouble != self._trouble:
            tell(trouble)
        self._trouble = trouble
        now = time.monotonic()
        self._next_checkpoint = now + max(self._interval, (now - began) / _LARGEST_SHARE)


def checkpointed_run(
    scene: Scene,
    parallel: Parallel,
    sink: Sink,
    keeper: CheckpointKeeper | None,
    on_progress: Callable[[float, float], None] | None = None,
) -> RunResults:
    """Make a run, from its checkpoint on if there is one.

    Collective.

    Parameters
    ----------
    scene : Scene
    parallel : Parallel
        The ranks that compute the run together.
    sink : Sink
        That takes what the run records, on this rank.
    keeper : CheckpointKeeper or None
        On the first rank.
    on_progress : callable, optional
        Called after every step with the time reached and the latest time at which the run ends.

    Returns
    -------
    RunResults
        On every rank.

    Raises
    ------
    Stopped
        On every rank, if the run was suspended, with a checkpoint, or canceled.
    """

    def after_step(simulation: Simulation) -> None:
        if on_progress and not simulation.relaxes:
            on_progress(simulation.time, scene.horizon)
        if simulation.done:
            return
        order = parallel.agree(keeper.order() if keeper else Order.GO_ON)
        if order in (Order.KEEP, Order.SUSPEND):
            began = time.monotonic()
            saved = simulation.saved()
            if keeper:
                keeper.write(saved, began)
        if order in (Order.SUSPEND, Order.CANCEL):
            raise Stopped

    return _begun(scene, parallel, sink, keeper).finish(after_step)


def _begun(scene: Scene, parallel: Parallel, sink: Sink, keeper: CheckpointKeeper | None) -> Simulation:
    """Return the simulation as it was kept, or else at its start.  Collective."""
    saved = parallel.agree(keeper.read() if keeper else None)
    if saved is not None:
        try:
            simulation = Simulation.restored(scene, saved, parallel=parallel, sink=sink)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            if keeper:
                keeper.begin_anew(f"another version wrote it ({type(error).__name__}: {error})")
        else:
            if keeper:
                tell(f"run {keeper.key} goes on from its checkpoint at time {simulation.time:g}")
            return simulation
    return Simulation(scene, parallel=parallel, sink=sink)
