"""A service whose store is damaged or whose disk is full says so, and goes on afterwards."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from sqlalchemy import Connection, text
from sqlalchemy.exc import OperationalError

from api.database.service_database import Database
from api.settings import Settings
from ensemble.store import Store
from ensemble.store.sql_database import CATALOG, Place, engine, reason, transaction
from tests.api.servers import client_of
from tests.ensemble.group_files import unpack
from tests.ensemble.runs import shear_run
from tests.full_disks import ROOM, filled, small_disk

DAMAGES: dict[str, Callable[[Path], object]] = {
    "missing array": lambda run: shutil.rmtree(run / "tangent_angle"),
    "truncated chunk": lambda run: (run / "gap" / "c" / "0").write_bytes(b"\x28\xb5"),
    "missing chunk": lambda run: (run / "center" / "c" / "0" / "0" / "0").unlink(),
    "missing attributes": lambda run: (run / "zarr.json").write_text('{"zarr_format":3,"node_type":"group"}'),
    "JSON cut short": lambda run: (run / "zarr.json").write_text('{"zarr_format":3,"no'),
    "empty directory": lambda run: (shutil.rmtree(run), run.mkdir()),
    "no directory": lambda run: shutil.rmtree(run),
}


def test_a_damaged_run_is_said_to_be_damaged(store: Path) -> None:
    with Store.open(store) as opened:
        key = opened.save(shear_run())
    run = unpack(store / "runs" / key)
    kept = shutil.copytree(run, store.with_name("kept"))
    with client_of(store) as client:
        for name, damage in DAMAGES.items():
            damage(run)
            responses = [client.get(f"/runs/{key}/{part}") for part in ("series", "frames", "flow")]
            refusals = [response for response in responses if response.status_code != 200]
            assert refusals, name  # a part that does not need what is damaged is given
            for response in refusals:
                assert response.status_code == 409, name
                assert response.headers["content-type"] == "application/problem+json"
                assert "damaged" in response.json()["detail"]
                assert str(store) not in response.text
            assert client.get(f"/runs/{key}").status_code == 200
            shutil.rmtree(run, ignore_errors=True)
            shutil.copytree(kept, run)
        assert client.get(f"/runs/{key}/series").status_code == 200


def test_a_full_disk_refuses_jobs_for_as_long_as_it_is_full(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", ROOM) as disk:
        Store.open(disk / "store").close()
        with client_of(disk / "store") as client:
            assert client.get("/readyz").status_code == 200
            with filled(disk):
                response = client.post("/jobs", json={"preset": "doublet-shear"})
                assert response.status_code == 503, response.text
                assert "full" in response.json()["detail"]
                assert response.headers["retry-after"]
                response = client.get("/readyz")
                assert response.status_code == 503
                assert "No space left on device" in response.json()["detail"]
                assert client.get("/jobs").json()["items"] == []
            assert client.get("/readyz").status_code == 200
            assert client.post("/jobs", json={"preset": "doublet-shear"}).status_code == 202


def test_a_store_that_is_moved_while_it_is_served_takes_no_job(store: Path) -> None:
    elsewhere = store.with_name("elsewhere")
    with client_of(store) as client:
        assert client.post("/jobs", json={"preset": "doublet-shear"}).status_code == 202
        store.rename(elsewhere)
        for _ in range(2):
            response = client.post("/jobs", json={"preset": "doublet-shear"})
            assert response.status_code == 503, response.text
            assert response.headers["retry-after"]
            assert client.get("/jobs").status_code == 503
            assert client.get("/readyz").status_code == 503
        assert not store.exists()
        elsewhere.rename(store)
        assert client.get("/readyz").status_code == 200
        assert client.post("/jobs", json={"preset": "doublet-shear"}).status_code == 202
        assert len(client.get("/jobs").json()["items"]) == 2


def write_and_then(opened: AbstractContextManager[Connection], trouble: Callable[[], object]) -> None:
    """Write in a transaction, and let something happen before it is committed."""
    with opened as connection:
        connection.execute(text("CREATE TABLE something (number INTEGER)"))
        trouble()


def test_what_is_committed_to_a_deleted_store_is_not_acknowledged(store: Path) -> None:
    # Costs 0.5 s.
    catalog = engine(Place.of(store).url, journal="delete")
    with pytest.raises(OperationalError, match="moved or deleted"):
        write_and_then(transaction(catalog), (store / CATALOG).unlink)
    catalog.dispose()
    with (
        Database.open(Settings(store=store).database_url, store) as database,
        pytest.raises(OperationalError, match="moved or deleted"),
    ):
        write_and_then(database.begin(), lambda: shutil.rmtree(store))


def test_a_full_disk_refuses_with_a_time_to_ask_again(tmp_path: Path) -> None:
    # Costs 1 s.
    with small_disk(tmp_path / "disk", ROOM) as disk:
        Store.open(disk / "store").close()
        with client_of(disk / "store") as client, filled(disk):
            assert client.get("/readyz").headers["retry-after"]


def test_an_error_without_words_has_a_reason() -> None:
    assert reason(TimeoutError()) == "TimeoutError"


def test_a_file_that_is_locked_keeps_nobody_else_waiting(store: Path) -> None:
    with Store.open(store) as opened:
        key = opened.save(shear_run())
    writer = sqlite3.connect(store / CATALOG, isolation_level=None)
    with client_of(store) as client, ThreadPoolExecutor(1) as pool:
        writer.execute("BEGIN EXCLUSIVE")
        answer = pool.submit(client.get, f"/runs/{key}")
        for _ in range(20):
            assert client.get("/healthz").status_code == 200, "the lock is held for as long as this takes"
            assert client.get("/jobs").status_code == 200
        assert not answer.done()
        writer.execute("ROLLBACK")
        assert answer.result().status_code == 200
    writer.close()
