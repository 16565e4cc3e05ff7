"""A Python client of the service: submit jobs, wait for them, read boundaries and runs as arrays.

>>> with Client("http://127.0.0.1:8000") as client:  # doctest: +SKIP
...     job = client.wait(client.submit("critical-hamaker", {"sweep.values": [0.5, 1.0]}))
...     boundary = client.boundary(job.key).to_xarray()
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, suppress
from functools import cached_property
from http import HTTPStatus
from ipaddress import ip_address
from itertools import count
from typing import TYPE_CHECKING, Any, Final
from urllib.request import getproxies, proxy_bypass
from uuid import uuid4

import httpx2
import numpy as np
from tenacity import RetryCallState, retry, retry_if_exception, stop_before_delay, wait_exponential

from api.jobs.job import Job
from api.jobs.submissions import Estimate, PresetDocument
from api.results.boundary_values import BoundaryDocument
from ensemble.errors import EnsembleError
from ensemble.questions import kind_of_model
from ensemble.search.boundary_reading import CriticalValueDocument, ReadingMethod
from ensemble.store.boundary_arrays import boundary_dataset
from ensemble.store.run_record import FRAME_DIMENSIONS, RunSummary
from solver.analysis.run import Array
from solver.scene import Model

if TYPE_CHECKING:
    import xarray

RETRY_SECONDS: Final = 60.0  # time for which requests to a service that cannot answer now are repeated
TIMEOUT_SECONDS: Final = 30.0  # of one request
VALUES_AT_ONCE: Final = 500_000  # in one answer; half of the default limit of the service
# Of a service in an outage, and of a proxy whose service is away.
UNAVAILABLE: Final = (HTTPStatus.BAD_GATEWAY, HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.GATEWAY_TIMEOUT)
# How a stream of events is interrupted.
INTERRUPTIONS: Final = (httpx2.NetworkError, httpx2.ProtocolError, httpx2.TimeoutException)


class Refused(EnsembleError):  # noqa: N818
    """The service refuses a request. The message is that of the service and names the field.

    Parameters
    ----------
    status : int
        HTTP status.
    problem : mapping
        The whole answer (RFC 9457).
    retry_after : int, optional
        Seconds after which the service wants to be asked again.

    Attributes
    ----------
    status : int
        HTTP status.
    problem : dict
        The whole answer (RFC 9457).
    retry_after : int or None
        Seconds after which the service wants to be asked again.
    """

    def __init__(self, status: int, problem: Mapping[str, Any], retry_after: int | None = None) -> None:
        super().__init__(problem["detail"])
        self.status = status
        self.problem = dict(problem)
        self.retry_after = retry_after


def _passes(error: BaseException) -> bool:
    """Tell whether the same request may succeed a little later."""
    if isinstance(error, Refused):
        return error.status in UNAVAILABLE or error.retry_after is not None
    return isinstance(error, httpx2.TransportError)


_growing_wait = wait_exponential(multiplier=0.1, max=5.0)


def _wait(state: RetryCallState) -> float:
    """Return the seconds until the next attempt: as the service says, or a time that grows."""
    error = state.outcome.exception() if state.outcome else None
    if isinstance(error, Refused) and error.retry_after is not None:
        return error.retry_after
    return _growing_wait(state)


# Repeating a request is safe: a submission has an idempotency key, so it makes one job.
_with_retries = retry(
    retry=retry_if_exception(_passes), wait=_wait, stop=stop_before_delay(RETRY_SECONDS), reraise=True
)


class TracedBoundary(BoundaryDocument):
    """A boundary in its present state."""

    def to_xarray(self) -> xarray.Dataset:
        """Return the points of the boundary over the values of the swept parameters.

        Returns
        -------
        Dataset
            Critical value, bracket, outcomes and status of each point, see
            `ensemble.store.boundary_arrays.boundary_dataset`.
        """
        return boundary_dataset(self)


class StoredRun:
    """A run in the store of a service. Its arrays are fetched when they are used.

    Parameters
    ----------
    summary : RunSummary
        Everything except the arrays.
    client : Client
    """

    def __init__(self, summary: RunSummary, client: Client) -> None:
        self.summary = summary
        self._client = client

    @cached_property
    def series(self) -> Mapping[str, Array]:
        """Time series of the diagnostics by name, NaN where a value is not finite."""
        names = self.summary.series
        pieces: dict[str, list[Array]] = {name: [] for name in names}
        for rows in self._pages("series", max(len(names), 1)):
            document = rows.json()
            for name, values in document["series"].items():
                pieces[name].append(np.array(values, dtype=float))
            if not names or sum(map(len, pieces[names[0]])) >= document["total"]:
                break
        return {name: np.concatenate(arrays) for name, arrays in pieces.items()}

    def _pages(self, part: str, values: int, **options: Any) -> Iterator[httpx2.Response]:
        """Yield consecutive answers about all rows of so many values, without end."""
        at_once = max(VALUES_AT_ONCE // values, 1)
        for start in count(step=at_once):
            rows = {"start": start, "stop": start + at_once}
            yield self._client.get(f"/runs/{self.summary.key}/{part}", params=rows, **options)

    def to_xarray(self) -> xarray.Dataset:
        """Return the arrays of the run.

        Returns
        -------
        Dataset
            Diagnostics over ``time``; positions and tensions of the membranes over ``frame_time``.
        """
        from xarray import Dataset

        frame_time, membranes = self._frames()
        time, *others = FRAME_DIMENSIONS["tension"]
        return Dataset(
            {name: ("time", values) for name, values in self.series.items() if name != "time"}
            | {
                "position": ((time, others[0], "axis", others[1]), membranes[:, :, :2]),
                "tension": ((time, *others), membranes[:, :, 2]),
            },
            coords={"time": self.series["time"], time: frame_time, "axis": ["x", "y"]},
            attrs={"key": self.summary.key, "outcome": str(self.summary.outcome)},
        )

    def _frames(self) -> tuple[Array, Array]:
        """Return times (frames,), and x, y and tension as (frames, vesicles, 3, points)."""
        vesicles, points = len(self.summary.scene.vesicles), self.summary.work.points
        assert points is not None
        values = 1 + 3 * vesicles * points
        found = []
        for page in self._pages("frames", values, headers={"Accept": "application/octet-stream"}):
            rows = np.frombuffer(page.content, dtype="<f4").reshape(-1, values).astype(float)
            found.append(rows)
            if len(rows) < max(VALUES_AT_ONCE // values, 1):
                break
        frames = np.concatenate(found)
        return frames[:, 0], frames[:, 1:].reshape(-1, vesicles, 3, points)


class Client(AbstractContextManager["Client"]):
    """A connection to a service.

    Use it as a context manager, or close it. While the service cannot be reached, for example during a
    restart, or answers that it is unavailable or when it wants to be asked again, requests are repeated for a
    minute at most; then `httpx2.TransportError` or `Refused` is raised. A service on this machine is reached
    directly, whatever proxy the environment names; for others the error names the proxy.

    Parameters
    ----------
    url : str
        Address of the service, for example ``http://127.0.0.1:8000``.
    token : str, optional
        Bearer token, for a service that requires tokens.
    """

    def __init__(self, url: str, token: str | None = None) -> None:
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        host = httpx2.URL(url).host
        self._proxy = None if _is_loopback(host) else _proxy_of(httpx2.URL(url))
        self._http = httpx2.Client(
            base_url=url, headers=headers, timeout=TIMEOUT_SECONDS, trust_env=not _is_loopback(host)
        )

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def presets(self) -> list[PresetDocument]:
        """Return the studies and scenes that ship with the service, with the largest cost of each."""
        return [PresetDocument.model_validate(item) for item in self._items("/presets")]

    def estimate(self, work: str | Model, changes: Mapping[str, Any] = {}) -> Estimate:
        """Return an upper bound of the cost of a job without submitting it.

        Parameters
        ----------
        work : str, Study or Scene
            Name of a preset, or what to carry out.
        changes : mapping
            Values by dotted path, for example ``{"flow.rate": 0.6}``.

        Returns
        -------
        Estimate

        Raises
        ------
        Refused
            If a field is invalid; the message names it.
        """
        answer = self._request("POST", "/estimate", json=_submission(work, changes))
        return Estimate.model_validate_json(answer.content)

    def submit(
        self,
        work: str | Model,
        changes: Mapping[str, Any] = {},
        ranks: int | None = None,
        seconds: float | None = None,
    ) -> Job:
        """Submit a job. It is on the disk of the service when this returns.

        Parameters
        ----------
        work : str or Model
            Name of a preset, or what to carry out.
        changes : mapping
            Values by dotted path, for example ``{"flow.rate": 0.6}``.
        ranks : int, optional
            Number of MPI processes.
        seconds : float, optional
            Time limit of one attempt, in seconds.

        Returns
        -------
        Job

        Raises
        ------
        Refused
            If the service does not accept the job; the message names the field.
        """
        limits = {
            name: value for name, value in (("ranks", ranks), ("seconds", seconds)) if value is not None
        }
        answer = self._request(
            "POST",
            "/jobs",
            json=_submission(work, changes) | limits,
            headers={"Idempotency-Key": str(uuid4())},
        )
        return Job.model_validate_json(answer.content)

    def job(self, identifier: str) -> Job:
        """Return a job in its present state.

        Parameters
        ----------
        identifier : str
            The `id` of the job.

        Returns
        -------
        Job
        """
        return Job.model_validate_json(self.get(f"/jobs/{identifier}").content)

    def jobs(self) -> Iterator[Job]:
        """Return all jobs, the latest first."""
        return map(Job.model_validate, self._items("/jobs"))

    def dismiss(self, job: Job) -> Job:
        """Dismiss a job. A finished job stays as it is.

        Parameters
        ----------
        job : Job

        Returns
        -------
        Job
            The job in its new state.
        """
        return Job.model_validate_json(self._request("DELETE", f"/jobs/{job.id}").content)

    def log(self, job: Job) -> str:
        """Return the log of the processes of a job; of a long log only the end.

        Parameters
        ----------
        job : Job

        Returns
        -------
        str
        """
        return self.get(f"/jobs/{job.id}/log").text

    def wait(self, job: Job, on_progress: Callable[[Job], None] | None = None) -> Job:
        """Wait until a job has succeeded, failed or been dismissed.

        Parameters
        ----------
        job : Job
        on_progress : callable, optional
            Called with the job in its present state and after each change.

        Returns
        -------
        Job
            The finished job.
        """
        for latest in self._listen(job):
            job = latest
            if on_progress is not None:
                on_progress(job)
        return job

    def _listen(self, job: Job) -> Iterator[Job]:
        """Yield the present state of a job and each new one, also across interrupted connections."""
        latest = job
        while not latest.status.finished:
            # Each stream begins with the state at that time.
            stream = self._request("GET", f"/jobs/{job.id}/events", stream=True)
            with closing(stream), suppress(*INTERRUPTIONS):
                for event in httpx2.EventSource(stream):
                    latest = Job.model_validate_json(event.data)
                    yield latest

    def boundaries(self) -> Iterator[TracedBoundary]:
        """Return all boundaries of the store."""
        return map(TracedBoundary.model_validate, self._items("/boundaries"))

    def boundary(self, key: str) -> TracedBoundary:
        """Return the boundary of a study in its present state.

        Parameters
        ----------
        key : str
            Key of the study, which is the `key` of its job. The boundary exists once the job has started.

        Returns
        -------
        TracedBoundary
        """
        return TracedBoundary.model_validate_json(self.get(f"/boundaries/{key}").content)

    def critical_value(
        self, key: str, parameters: Mapping[str, float], method: ReadingMethod = ReadingMethod.INTERPOLATED
    ) -> CriticalValueDocument:
        """Read a critical value from a boundary.

        Parameters
        ----------
        key : str
            Key of the study.
        parameters : mapping
            Values of the swept parameters by their dotted paths, for example ``{"flow.rate": 0.6}``.
        method : ReadingMethod
            Interpolate between two points, or take the nearest point.

        Returns
        -------
        CriticalValueDocument
            The critical value with its uncertainty.

        Raises
        ------
        Refused
            If the value lies outside the points of the boundary.
        """
        answer = self.get(f"/boundaries/{key}/at", params={**parameters, "method": str(method)})
        return CriticalValueDocument.model_validate_json(answer.content)

    def runs(self, *where: str, reports: bool = False) -> Iterator[StoredRun]:
        """Return the runs that meet all conditions, the newest first.

        Parameters
        ----------
        *where : str
            Conditions, for example ``outcome=bound`` or ``flow.rate>=0.5``.
        reports : bool
            Whether runs that were made for reports are among them.

        Returns
        -------
        iterator of StoredRun
        """
        summaries = map(
            RunSummary.model_validate, self._items("/runs", {"where": list(where), "reports": reports})
        )
        return (StoredRun(summary, self) for summary in summaries)

    def run(self, key: str) -> StoredRun:
        """Return a run.

        Parameters
        ----------
        key : str
            Key of the run, which is the `key` of the job of a scene.

        Returns
        -------
        StoredRun
        """
        return StoredRun(RunSummary.model_validate_json(self.get(f"/runs/{key}").content), self)

    def get(self, path: str, **options: Any) -> httpx2.Response:
        """Send a GET request.

        Parameters
        ----------
        path : str
            Path, for example ``/runs``.
        **options
            Options of `httpx2.Client.build_request`, for example ``params``.

        Returns
        -------
        httpx2.Response

        Raises
        ------
        Refused
            If the service refuses the request.
        """
        return self._request("GET", path, **options)

    @_with_retries
    def _request(self, method: str, path: str, stream: bool = False, **options: Any) -> httpx2.Response:
        request = self._http.build_request(method, path, **options)
        try:
            return _checked(self._http.send(request, stream=stream))
        except httpx2.TransportError as error:
            if self._proxy is not None:
                error.add_note(f"The environment sends this request through the proxy {self._proxy}.")
            raise

    def _items(self, path: str, parameters: Mapping[str, Any] = {}) -> Iterator[dict[str, Any]]:
        page = self.get(path, params=parameters).json()
        yield from page["items"]
        while page["next"]:
            page = self.get(page["next"]).json()
            yield from page["items"]


def _is_loopback(host: str) -> bool:
    """Tell whether a host name or address is this machine's own."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _proxy_of(url: httpx2.URL) -> str | None:
    """Return the proxy that the environment names for an address."""
    return None if proxy_bypass(url.host) else getproxies().get(url.scheme)


def _submission(work: str | Model, changes: Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(work, str):
        return {"preset": work, "set": dict(changes)}
    return {kind_of_model(work).kind: work.model_dump(mode="json"), "set": dict(changes)}


def _checked(response: httpx2.Response) -> httpx2.Response:
    if response.is_success:
        return response
    response.read()
    is_problem = "problem+json" in response.headers.get("Content-Type", "")
    retry_after = response.headers.get("Retry-After", "")
    raise Refused(
        response.status_code,
        response.json() if is_problem else {"detail": response.reason_phrase},
        int(retry_after) if retry_after.isdecimal() else None,
    )
