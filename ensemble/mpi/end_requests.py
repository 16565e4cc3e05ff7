"""Requests to end a job that can stop after a step: signals, whichever of its ranks they reach."""

from __future__ import annotations

import threading
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, ClassVar

from ensemble.errors import Interrupted
from ensemble.mpi.world import tell

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm, Request

_REQUESTS = 3  # tag of messages to the first rank


class EndRequests(AbstractContextManager["EndRequests"]):
    """Takes requests to end, within a block.

    Only the first rank learns of them, because it decides for all.  A request holds for the rest of the
    process: each later block has it from the start.  Entering and leaving is collective, but for errors.

    Parameters
    ----------
    communicator : Intracomm or None
        All ranks; None if this process is alone.
    """

    _current: ClassVar[EndRequests | None] = None
    _signaled: ClassVar[bool] = False  # this process has accepted a request
    _told: ClassVar[bool] = False
    # A signal handler runs in the main thread, which may be the one that holds the lock.
    _lock: ClassVar[threading.RLock] = threading.RLock()

    def __init__(self, communicator: Intracomm | None) -> None:
        self._communicator = communicator
        self._rank = 0 if communicator is None else communicator.Get_rank()
        self._asked = self._leaves = False
        self._sent: Request | None = None
        self._received = 0

    @classmethod
    def ask(cls) -> bool:
        """Ask the job of this process to end after its next step.

        Returns
        -------
        bool
            False if it cannot, or this process has asked before: then it has to end at once.
        """
        current = cls._current
        return current is not None and current._take()

    @classmethod
    def accepted(cls) -> bool:
        """Tell whether this process has accepted a request.

        Returns
        -------
        bool
        """
        return cls._signaled

    @property
    def arrived(self) -> bool:
        """Whether the job has been asked to end; to be read on the first rank."""
        if not self._asked and self._communicator is not None and self._communicator.Get_size() > 1:
            self._receive()
        return self._asked

    def __enter__(self) -> EndRequests:
        """Take requests from now on, and learn of those that earlier blocks have accepted."""
        earlier = EndRequests._signaled
        EndRequests._current = self
        if self._communicator is not None:
            earlier = any(self._communicator.allgather(earlier))
        if earlier and self._rank == 0:
            self._note()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Pass no request on any more, wait for all ranks, and receive what is on its way."""
        with self._lock:
            self._leaves = True
        if self._communicator is not None and (kind is None or issubclass(kind, Interrupted)):
            sent: int = self._communicator.allreduce(int(self._sent is not None))
            while self._rank == 0 and self._received < sent:
                self._receive()
            if self._sent is not None:
                self._sent.wait()
        EndRequests._current = None

    def _take(self) -> bool:
        with self._lock:
            # A launcher signals all ranks: the message of another one may have come before.
            if EndRequests._signaled:
                return False
            EndRequests._signaled = True
            if self._leaves:  # the work is done, or suspended already
                return True
            if self._communicator is not None and self._rank > 0:
                self._sent = self._communicator.isend(None, dest=0, tag=_REQUESTS)
            else:
                self._note()
            return True

    def _receive(self) -> None:
        assert self._communicator is not None
        message = self._communicator.improbe(tag=_REQUESTS)
        if message is not None:
            message.recv()
            self._received += 1
            self._note()

    def _note(self) -> None:
        """Note on the first rank that the job is asked to end, and say so once."""
        if self._leaves:
            return
        self._asked = True
        if not EndRequests._told:
            EndRequests._told = True
            tell("ends after the next step of its runs; the same command goes on (a second signal: at once)")
