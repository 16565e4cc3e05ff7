"""Runs over HTTP are those of the store."""

from __future__ import annotations

import shutil
import socket
import tracemalloc
from io import BytesIO
from pathlib import Path

import h5py
import httpx2
import numpy as np
import pytest

from api.auth import TokenScope
from api.auth.tokens import Tokens
from api.database.service_database import Database
from api.results.run_arrays import FrameSelection
from api.settings import Settings
from ensemble.config.measured import measured_fields
from ensemble.store import Store
from solver.analysis.run import Outcome
from solver.membrane.curve import positions
from solver.scene import Units
from tests.api.servers import client_of, make_token
from tests.api.stores import FRAMES, RATES, example_boundary
from tests.ensemble.group_files import pack, unpack
from tests.ensemble.runs import shear_run, shear_scene

BINARY = {"Accept": "application/octet-stream"}


@pytest.fixture
def bound_run(filled_store: Path, reading: httpx2.Client) -> str:
    """Key of a run in which every quantity is present."""
    with Store.existing(filled_store) as store:
        return store.summaries(["flow.rate=0.75"])[0].key


def test_runs_of_reports_are_listed_if_asked_for(tmp_path):
    with Store.open(tmp_path / "store", report="paper") as store, client_of(store.path) as client:
        store.save(shear_run())
        assert found(client) == []
        assert [run["report"] for run in found(client, reports=True)] == ["paper"]
        assert found(client, where="report=paper") == found(client, reports=True)


def test_a_run_is_given_as_a_figure(reading, bound_run):
    answer = reading.get(f"/runs/{bound_run}/file?format=png")
    assert answer.headers["content-type"] == "image/png"
    assert answer.headers["content-disposition"] == f'attachment; filename="run-{bound_run[:8]}.png"'
    assert answer.content.startswith(b"\x89PNG")
    assert reading.get(f"/runs/{'0' * 32}/file?format=png").status_code == 404


def test_a_run_is_given_for_paraview(reading, bound_run):
    answer = reading.get(f"/runs/{bound_run}/file?format=vtkhdf")
    assert answer.status_code == 200
    with h5py.File(BytesIO(answer.content)) as file:
        assert file["VTKHDF"].attrs["Type"] == b"PolyData"


def found(client: httpx2.Client, **query: object) -> list[dict]:
    response = client.get("/runs", params=query)
    assert response.status_code == 200, response.text
    return response.json()["items"]


def test_runs_are_listed_newest_first(reading, filled_store):
    with Store.existing(filled_store) as store:
        expected = [summary.document() for summary in store.summaries()]
    assert found(reading) == expected[::-1]


def test_filters_name_fields_of_the_scene_and_results(reading):
    rates = [
        run["scene"]["flow"]["rate"] for run in found(reading, where=["flow.rate>=0.75", "outcome=bound"])
    ]
    assert rates == [1.0, 0.875, 0.75]
    (failed,) = found(reading, where="outcome=failed")
    assert failed["scene"]["flow"] is None


@pytest.mark.parametrize("limit", [1, 2, 4, 5, 6, 100])
def test_pages_joined_are_the_whole_list(reading, limit):
    where = "flow.rate>0"
    whole = found(reading, where=where)
    assert len(whole) == len(RATES)
    pages, address = (
        [],
        str(reading.build_request("GET", "/runs", params={"where": where, "limit": limit}).url),
    )
    while address:
        page = reading.get(address).json()
        assert len(page["items"]) <= limit
        pages += page["items"]
        address = page["next"]
    assert pages == whole


def test_pages_do_not_shift_when_runs_arrive_between_them(tmp_path):
    with Store.open(tmp_path / "store") as store, client_of(store.path) as client:
        earlier = [store.save(shear_run(shear_scene(rate=rate), seed=1)) for rate in (1.0, 2.0, 3.0)]
        page = client.get("/runs", params={"limit": 2}).json()
        store.save(shear_run(shear_scene(rate=4.0), seed=2))
        rest = client.get(page["next"]).json()
        assert [run["key"] for run in page["items"] + rest["items"]] == earlier[::-1]
        assert rest["next"] is None
        assert client.get("/runs").json()["items"][0]["scene"]["flow"]["rate"] == 4.0


@pytest.mark.parametrize(
    ("query", "named"),
    [
        ({"where": "no_such_field=1"}, "no_such_field"),
        ({"where": "flow.rate"}, "path op value"),
        ({"where": "outcome=lost"}, "outcome"),
        ({"limit": 0}, "limit"),
        ({"limit": 1001}, "limit"),
        ({"after": "0" * 32}, "after"),
    ],
)
def test_bad_queries_are_refused_and_named(reading, query, named):
    response = reading.get("/runs", params=query)
    assert response.status_code == 422
    assert response.headers["content-type"] == "application/problem+json"
    assert named in response.json()["detail"]


def test_a_run_is_its_summary(reading, filled_store, bound_run):
    with Store.existing(filled_store) as store:
        assert reading.get(f"/runs/{bound_run}").json() == store.summary(bound_run).document()


def test_series_are_those_of_the_run(reading, filled_store, bound_run):
    with Store.existing(filled_store) as store:
        run = store.load(bound_run)
    series = reading.get(f"/runs/{bound_run}/series").json()["series"]
    assert series == {name: values.tolist() for name, values in run.series.items()}
    chosen = reading.get(f"/runs/{bound_run}/series", params={"name": ["time", "gap"]}).json()["series"]
    assert chosen == {name: series[name] for name in ("gap", "time")}
    refused = reading.get(f"/runs/{bound_run}/series", params={"name": "weight"})
    assert refused.status_code == 422
    assert "weight" in refused.json()["detail"]


@pytest.mark.parametrize("query", [{}, {"stride": 3}, {"start": 2, "stop": 7, "stride": 2}, {"start": 10**9}])
def test_some_records_may_be_chosen(reading, filled_store, bound_run, query):
    with Store.existing(filled_store) as store:
        gap = store.load(bound_run).series["gap"]
    chosen = slice(query.get("start", 0), query.get("stop"), query.get("stride", 1))
    answer = reading.get(f"/runs/{bound_run}/series", params=query | {"name": "gap"}).json()
    assert answer == {"series": {"gap": gap[chosen].tolist()}, "total": len(gap)}


def test_too_many_records_at_once_are_refused_with_the_number(filled_store, bound_run):
    with client_of(filled_store, frame_values=8) as client:
        address = f"/runs/{bound_run}/series"
        refused = client.get(address, params={"name": ["time", "gap"]})
        assert refused.status_code == 422
        assert "at most 4" in refused.json()["detail"]
        few = client.get(address, params={"name": ["time", "gap"], "stop": 4})
        assert len(few.json()["series"]["gap"]) == 4


def test_frames_as_json_are_points_in_the_plane(reading, filled_store, bound_run):
    with Store.existing(filled_store) as store:
        run = store.load(bound_run)
    frames = reading.get(f"/runs/{bound_run}/frames").json()
    expected = positions(run.frames.tangent_angle, run.frames.center, 2 * np.pi)
    assert frames["total"] == FRAMES
    assert frames["index"] == list(range(FRAMES))
    assert np.array_equal(frames["time"], run.frames.time)
    assert np.array_equal(frames["position"], expected)
    assert np.array_equal(frames["tension"], run.frames.tension)


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ({}, range(FRAMES)),
        ({"stride": 3}, range(0, FRAMES, 3)),
        ({"start": 2, "stop": 7, "stride": 2}, range(2, 7, 2)),
        ({"start": FRAMES}, range(0)),
        ({"start": 8, "stop": 10**9}, range(8, FRAMES)),
    ],
)
def test_binary_frames_are_the_same(reading, bound_run, query, expected):
    document = reading.get(f"/runs/{bound_run}/frames", params=query).json()
    assert document["index"] == list(expected)
    binary = reading.get(f"/runs/{bound_run}/frames", params=query, headers=BINARY)
    assert binary.headers["content-type"] == "application/octet-stream"
    frames = np.frombuffer(binary.content, dtype="<f4").reshape(len(expected), 1 + 2 * 3 * 32)
    membranes = frames[:, 1:].reshape(-1, 2, 3, 32)
    assert np.array_equal(frames[:, 0], np.float32(document["time"]))
    if len(expected):
        assert np.array_equal(membranes[:, :, :2], np.float32(document["position"]))
        assert np.array_equal(membranes[:, :, 2], np.float32(document["tension"]))


def test_what_is_not_finite_is_null_in_json(reading):
    (failed,) = found(reading, where="outcome=failed")
    assert failed["error"]["area"] == "NaN"
    frames = reading.get(f"/runs/{failed['key']}/frames").json()
    assert set(frames["tension"][0][0]) == {None}


def test_too_many_frames_at_once_are_refused_with_the_number(filled_store, bound_run):
    values_each = 1 + 2 * 3 * 32
    with client_of(filled_store, frame_values=4 * values_each) as client:
        refused = client.get(f"/runs/{bound_run}/frames")
        assert refused.status_code == 422
        assert "at most 4" in refused.json()["detail"]
        assert client.get(f"/runs/{bound_run}/frames", params={"stride": 3}).json()["index"] == [0, 3, 6, 9]


def test_the_flow_is_sampled_around_the_vesicles(reading, filled_store, bound_run):
    with Store.existing(filled_store) as store:
        run = store.load(bound_run)
    field = reading.get(f"/runs/{bound_run}/flow").json()
    x, y = np.meshgrid(field["x"], field["y"])
    np.testing.assert_allclose(field["velocity"], [0.75 * y, 0 * x], atol=1e-12)
    everywhere = positions(run.frames.tangent_angle, run.frames.center, 2 * np.pi)
    for coordinate, values in zip("xy", np.moveaxis(everywhere, 2, 0), strict=True):
        assert field[coordinate][0] < values.min() < values.max() < field[coordinate][-1]


def test_a_fluid_at_rest_has_no_flow(reading):
    (failed,) = found(reading, where="outcome=failed")
    assert failed["scene"]["flow"] is None
    assert reading.get(f"/runs/{failed['key']}/flow").json() is None


def test_a_number_times_the_size_of_its_unit_is_what_the_terminal_shows(tmp_path, reading, bound_run):
    units = Units(radius="10 um", bending_modulus="1e-19 J", viscosity="1 mPa*s")
    with Store.open(tmp_path / "store") as store, client_of(store.path) as client:
        key = store.save(shear_run(shear_scene().model_copy(update={"units": units})))
        sizes = client.get(f"/runs/{key}/units").json()["sizes"]
        summary = store.summary(key)
        document = summary.document()
        boundary = example_boundary().in_units(units)
        store.save_boundary(boundary)
        of_boundary = client.get(f"/boundaries/{boundary.study_key}/units").json()["sizes"]
    shown = measured_fields(summary, document, units)
    for name in ("time", "period", "gap"):
        assert sizes[name]["value"] * document[name] == pytest.approx(shown[name].value, rel=1e-12)
        assert sizes[name]["unit"] == shown[name].unit
    assert sizes["bending_energy"]["unit"] == shown["energy.bending"].unit
    point = boundary.measured()[0]["critical_value"]
    size = of_boundary["adhesion.hamaker"]
    assert size["value"] * boundary.points[0].critical_value == pytest.approx(point.value, rel=1e-12)
    assert (size["unit"], of_boundary["flow.rate"]["unit"]) == (point.unit, "1/s")
    assert reading.get(f"/runs/{bound_run}/units").json() == {"sizes": {}}


@pytest.mark.parametrize("part", ["", "/series", "/frames", "/flow", "/units"])
def test_what_never_changes_is_sent_once(reading, bound_run, part):
    first = reading.get(f"/runs/{bound_run}{part}")
    assert "immutable" in first.headers["cache-control"]
    again = reading.get(f"/runs/{bound_run}{part}", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == first.headers["etag"]
    other = reading.get(f"/runs/{bound_run}{part}", headers={"If-None-Match": '"another"'})
    assert other.content == first.content


def test_tags_of_different_frames_differ(reading, bound_run):
    address = f"/runs/{bound_run}/frames"
    answers = [
        reading.get(address),
        reading.get(address, headers=BINARY),
        reading.get(address, params={"stride": 2}),
        reading.get(address, params={"start": 2}),
    ]
    assert len({answer.headers["etag"] for answer in answers}) == len(answers)


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A store with a run whose arrays have many chunks, and the key of the run."""
    path = tmp_path_factory.mktemp("long") / "store"
    with Store.open(path) as store:
        return path, store.save(shear_run(shear_scene(rate=0.5), seed=1, samples=60_000, frames=20_000))


@pytest.fixture
def unpacked_run(tmp_path, long_run) -> tuple[Path, str]:
    """A copy of it whose chunks are files."""
    path, key = shutil.copytree(long_run[0], tmp_path / "unpacked"), long_run[1]
    unpack(path / "runs" / key)
    return path, key


def test_only_chunks_that_are_asked_for_are_read(unpacked_run):
    """The others may even be damaged."""
    path, key = unpacked_run
    arrays = path / "runs" / key
    chunks = sorted((arrays / "tangent_angle").glob("c/*/0/0"), key=lambda file: int(file.parts[-3]))
    assert len(chunks) > 3
    chunks[-1].write_bytes(b"damaged")
    for pack_again in (False, True):
        if pack_again:
            pack(arrays)
        with client_of(path) as client:
            for address in (f"/runs/{key}/frames?stop=1", f"/runs/{key}/frames?start=100&stop=200&stride=7"):
                assert client.get(address).status_code == 200
                assert client.get(address, headers=BINARY).status_code == 200
            assert client.get(f"/runs/{key}/flow").status_code == 200
            assert client.get(f"/runs/{key}/frames?start=19999").status_code == 409


def test_answers_about_a_long_run_need_little_memory(long_run):
    """More than a piece at a time is neither read nor written."""
    path, key = long_run
    numbers = range(0, 20_000, 4)
    with Store.existing(path) as store:
        selection = FrameSelection.of(store.arrays(key), numbers, 10**9)
        for pieces in (selection.json(), selection.binary()):
            tracemalloc.start()
            size = sum(len(piece) for piece in pieces)
            (_, peak), _ = tracemalloc.get_traced_memory(), tracemalloc.stop()
            assert size > 3_000_000
            assert peak < 16 << 20
        whole = store.load(key).frames
        frames = np.frombuffer(b"".join(selection.binary()), dtype="<f4").reshape(len(numbers), -1)
        assert len(frames[0]) * 4 * len(numbers) == selection.size
        assert np.array_equal(frames[:, 0], np.float32(whole.time[numbers]))
        assert np.array_equal(frames[:, -32:], np.float32(whole.tension[numbers, 1]))


def test_rows_are_those_of_the_whole_array(long_run):
    path, key = long_run
    with Store.existing(path) as store:
        arrays, frames = store.arrays(key), store.load(key).frames
    for numbers in (range(0), range(5), range(3, 19_999, 1), range(0, 20_000, 4099), range(19_999, 20_000)):
        assert np.array_equal(arrays.rows("tangent_angle", numbers), frames.tangent_angle[numbers])
        assert np.array_equal(arrays.rows("frame_time", numbers), frames.time[numbers])


def test_a_lost_chunk_is_an_error_and_not_numbers(unpacked_run):
    path, key = unpacked_run
    chunk = path / "runs" / key / "tension" / "c" / "0" / "0" / "0"
    chunk.unlink()
    for pack_again in (False, True):
        if pack_again:
            pack(path / "runs" / key)
        with client_of(path) as client:
            assert client.get(f"/runs/{key}/frames?start=19999").status_code == 409


@pytest.mark.parametrize("part", ["frames", "frames?stride=2", "series"])
def test_an_answer_under_way_ends_with_its_token(tmp_path, long_run, part):
    path, key = long_run
    store = tmp_path / "store"
    shutil.copytree(path, store)
    token = make_token(store, "ada", TokenScope.READ)
    with client_of(store, token, frame_values=10**8) as client:
        whole = len(client.get(f"/runs/{key}/{part}", headers={"Accept-Encoding": "identity"}).content)
        assert whole > 1 << 23, "more than buffers of the kernel hold"
        parts = client.base_url
        with socket.socket() as connection:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
            connection.settimeout(60)
            connection.connect((parts.host, parts.port))
            head = (
                f"GET /runs/{key}/{part} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\n\r\n"
            )
            connection.sendall(head.encode())
            received = len(connection.recv(1000))
            with Database.open(Settings(store=store).database_url, store) as database:
                Tokens(database).revoke(token.split(".")[0])
            try:
                while piece := connection.recv(65536):
                    received += len(piece)
            except ConnectionResetError:
                pass
        assert received < whole, "the answer is cut off, and the client sees that"


def test_long_answers_are_compressed_and_short_ones_and_numbers_are_not(reading, bound_run):
    def encoding(address: str, **headers: str) -> str | None:
        return reading.get(address, headers=headers).headers.get("content-encoding")

    assert encoding("/runs") == encoding("/presets") == encoding(f"/runs/{bound_run}/frames") == "gzip"
    assert encoding("/runs", **{"Accept-Encoding": "identity"}) is None
    assert encoding("/healthz") is None
    assert encoding(f"/runs/{bound_run}/frames", **BINARY) is None
    assert "accept-encoding" in reading.get("/runs").headers["vary"].lower()


@pytest.mark.parametrize("part", ["", "/series", "/frames", "/flow", "/units"])
def test_an_unknown_run_is_not_found(reading, part):
    response = reading.get(f"/runs/{'0' * 32}{part}")
    assert response.status_code == 404
    assert response.json()["title"] == "Not Found"


def test_a_run_appears_as_soon_as_another_process_has_saved_it(ensemble, tmp_path):
    Store.open(tmp_path / "store").close()
    with client_of(tmp_path / "store") as client:
        assert found(client) == []
        arguments = [
            "--set=numerics.points=32",
            "--set=numerics.tolerance=1e-3",
            f"--store={tmp_path / 'store'}",
        ]
        assert ensemble("run", "doublet-shear", *arguments).returncode == 0
        (run,) = found(client)
        assert run["outcome"] == Outcome.BOUND
