"""Talks to a service from Python: submits jobs, waits for them, and reads boundaries and runs as arrays.

with Client("http://127.0.0.1:8000") as client:
    job = client.wait(client.submit("critical-hamaker", {"sweep.values": [0.5, 1.0]}))
    boundary = client.boundary(job.key).to_xarray()
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final
from uuid import uuid4

import httpx
import numpy as np
from httpx_sse import connect_sse
from tenacity import retry, retry_if_exception_type, stop_after_delay, wait_exponential

from api.jobs.cost_estimate import Estimate
from api.jobs.job import Job
from api.jobs.submissions import PresetDocument
from api.results.boundary_values import BoundaryDocument, CriticalValueDocument, ReadingMethod
from ensemble.config.study import Study
from ensemble.errors import EnsembleError
from ensemble.store.run_record import FRAME_DIMENSIONS, RunSummary
from solver.analysis.run import Array
from solver.scene import Scene

if TYPE_CHECKING:
    import xarray

PATIENCE: Final = 60.0  # seconds for which a service that cannot be reached is asked again
SECONDS_TO_ANSWER: Final = 30.0

# Nothing that is asked of a service is done twice when it is asked twice: a job carries an idempotency key.
_persistent = retry(
    retry=retry_if_exception_type(httpx.TransportError),
    wait=wait_exponential(multiplier=0.1, max=5.0),
    stop=stop_after_delay(PATIENCE),
    reraise=True,
)


class Refused(EnsembleError):  # noqa: N818
    """The service refuses a request; the message is its own and names the field.

    Attributes
    ----------
    status : int
        Of HTTP.
    problem : dict
        The whole answer, as RFC 9457 describes it.
    """

    def __init__(self, status: int, problem: Mapping[str, Any]) -> None:
        super().__init__(problem["detail"])
        self.status = status
        self.problem = dict(problem)


class TracedBoundary(BoundaryDocument):
    """A boundary as far as it is known."""

    def to_xarray(self) -> xarray.Dataset:
        """Points along the swept parameter: critical value, bracket, outcomes, status.

        Numbers that are not known yet are NaN, outcomes empty.
        """
        from xarray import Dataset

        swept = self.study["sweep"]["parameter"]
        points = sorted(self.points, key=lambda point: point.parameters[swept])
        sides = range(2)
        return Dataset(
            {
                "critical_value": (swept, [_number(point.critical_value) for point in points]),
                "bracket": (
                    (swept, "side"),
                    [[_number(point.bracket[side]) for side in sides] for point in points],
                ),
                "outcome": (
                    (swept, "side"),
                    [[point.outcomes[side] or "" for side in sides] for point in points],
                ),
                "status": (swept, [point.status for point in points]),
                "certified": (swept, [point.certified for point in points]),
            },
            coords={swept: [point.parameters[swept] for point in points], "side": ["low", "high"]},
            attrs={
                "name": self.name,
                "study_key": self.study_key,
                "parameter": self.study["search"]["parameter"],
            },
        )


class StoredRun:
    """A run in the store of a service; arrays are fetched when they are asked for.

    Parameters
    ----------
    summary : RunSummary
        Everything but the arrays.
    client : Client
    """

    def __init__(self, summary: RunSummary, client: Client) -> None:
        self.summary = summary
        self._client = client

    @cached_property
    def series(self) -> Mapping[str, Array]:
        """Diagnostics over time by name; NaN where a value is not finite."""
        document = self._client.get(f"/runs/{self.summary.key}/series").json()
        return {name: np.array(values, dtype=float) for name, values in document["series"].items()}

    def to_xarray(self) -> xarray.Dataset:
        """Diagnostics over ``time``; positions and tensions of the membranes over ``frame_time``."""
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
        """Times of the frames; x, y and tension of all points of each vesicle."""
        vesicles, points = len(self.summary.scene.vesicles), self.summary.work.points
        assert points is not None
        octets = self._client.get(
            f"/runs/{self.summary.key}/frames", headers={"Accept": "application/octet-stream"}
        ).content
        rows = np.frombuffer(octets, dtype="<f4").reshape(-1, 1 + 3 * vesicles * points).astype(float)
        return rows[:, 0], rows[:, 1:].reshape(-1, vesicles, 3, points)


class Client(AbstractContextManager["Client"]):
    """A service at an address.

    Use it as a context manager, or close it.  While the service cannot be reached, as while it is started
    anew, requests are repeated for a minute; what then is raised is `httpx.TransportError`.

    Parameters
    ----------
    url : str
        Such as ``http://127.0.0.1:8000``.
    token : str, optional
        For a service that asks for one.
    """

    def __init__(self, url: str, token: str | None = None) -> None:
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._http = httpx.Client(base_url=url, headers=headers, timeout=SECONDS_TO_ANSWER)

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def presets(self) -> list[PresetDocument]:
        """Studies and scenes that ship with the service, and what they may cost."""
        return [PresetDocument.model_validate(item) for item in self._items("/presets")]

    def estimate(self, work: str | Study | Scene, changes: Mapping[str, Any] = {}) -> Estimate:
        """What a job may cost, without submitting it.

        Parameters
        ----------
        work, changes
            As `submit` takes them.

        Raises
        ------
        Refused
            If they do not describe a job; names the field.
        """
        answer = self._request("POST", "/estimate", json=_submission(work, changes))
        return Estimate.model_validate_json(answer.content)

    def submit(
        self,
        work: str | Study | Scene,
        changes: Mapping[str, Any] = {},
        ranks: int | None = None,
        seconds: float | None = None,
    ) -> Job:
        """Submit a job; it is on the service's disk when this returns.

        Parameters
        ----------
        work : str, Study or Scene
            Name of a preset, or what to carry out.
        changes : mapping
            Values by dotted path, such as ``{"flow.rate": 0.6}``.
        ranks : int, optional
            Processes to use.
        seconds : float, optional
            How long it may take.

        Raises
        ------
        Refused
            If the service does not accept it; names the field.
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
        """Where a job stands."""
        return Job.model_validate_json(self.get(f"/jobs/{identifier}").content)

    def jobs(self) -> Iterator[Job]:
        """All jobs, the latest first."""
        return map(Job.model_validate, self._items("/jobs"))

    def dismiss(self, job: Job) -> Job:
        """Give a job up, and return it; one that is finished stays as it is."""
        return Job.model_validate_json(self._request("DELETE", f"/jobs/{job.id}").content)

    def log(self, job: Job) -> str:
        """What the job's processes have said so far."""
        return self.get(f"/jobs/{job.id}/log").text

    def wait(self, job: Job, on_progress: Callable[[Job], None] | None = None) -> Job:
        """Wait until a job has finished, however it does, and return it.

        Parameters
        ----------
        job : Job
        on_progress : callable, optional
            Called with the job as it is, and again each time it has changed.
        """
        for latest in self._listen(job):
            job = latest
            if on_progress is not None:
                on_progress(job)
        return job

    def _listen(self, job: Job) -> Iterator[Job]:
        """The job as it is, and again each time it changes, also across interrupted connections."""
        while not job.status.finished:
            try:
                for job in self._events(job):  # noqa: B020  the connection after this one is about the latest
                    yield job
            except httpx.TransportError:
                # Waits for the service to come back; the events start anew with the job as it is then.
                self.get("/healthz")

    def _events(self, job: Job) -> Iterator[Job]:
        with connect_sse(self._http, "GET", f"/jobs/{job.id}/events") as source:
            _accepted(source.response)
            for event in source.iter_sse():
                yield Job.model_validate_json(event.data)

    def boundaries(self) -> Iterator[TracedBoundary]:
        """All boundaries of the store."""
        return map(TracedBoundary.model_validate, self._items("/boundaries"))

    def boundary(self, key: str) -> TracedBoundary:
        """The boundary of a study; a job's `key` names it while it is being traced."""
        return TracedBoundary.model_validate_json(self.get(f"/boundaries/{key}").content)

    def critical_value(
        self, key: str, parameters: Mapping[str, float], method: ReadingMethod = ReadingMethod.INTERPOLATED
    ) -> CriticalValueDocument:
        """Read a critical value off a boundary, with its uncertainty.

        Parameters
        ----------
        key : str
            Of the boundary.
        parameters : mapping
            Value of the swept parameter by its dotted path.
        method : ReadingMethod
            Between two points, or of the nearest.
        """
        answer = self.get(f"/boundaries/{key}/at", params={**parameters, "method": str(method)})
        return CriticalValueDocument.model_validate_json(answer.content)

    def runs(self, *where: str) -> Iterator[StoredRun]:
        """Runs that meet all conditions, such as ``outcome=bound`` or ``flow.rate>=0.5``, newest first."""
        summaries = map(RunSummary.model_validate, self._items("/runs", {"where": list(where)}))
        return (StoredRun(summary, self) for summary in summaries)

    def run(self, key: str) -> StoredRun:
        """One run."""
        return StoredRun(RunSummary.model_validate_json(self.get(f"/runs/{key}").content), self)

    def get(self, path: str, **options: Any) -> httpx.Response:
        """Get a path of the service, with options as `httpx.Client.request` takes them.

        Raises
        ------
        Refused
            If the service refuses it.
        """
        return self._request("GET", path, **options)

    @_persistent
    def _request(self, method: str, path: str, **options: Any) -> httpx.Response:
        return _accepted(self._http.request(method, path, **options))

    def _items(self, path: str, parameters: Mapping[str, Any] = {}) -> Iterator[dict[str, Any]]:
        page = self.get(path, params=parameters).json()
        yield from page["items"]
        while page["next"]:
            page = self.get(page["next"]).json()
            yield from page["items"]


def _submission(work: str | Study | Scene, changes: Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(work, str):
        return {"preset": work, "set": dict(changes)}
    name = "study" if isinstance(work, Study) else "scene"
    return {name: work.model_dump(mode="json"), "set": dict(changes)}


def _accepted(response: httpx.Response) -> httpx.Response:
    if response.is_success:
        return response
    response.read()
    is_problem = "json" in response.headers.get("Content-Type", "")
    raise Refused(response.status_code, response.json() if is_problem else {"detail": response.reason_phrase})


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
