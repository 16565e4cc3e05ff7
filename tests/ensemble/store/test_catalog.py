"""The catalog in a file and on a server: one set of tests, and what is special about a server."""

from __future__ import annotations

import shutil
import stat
from datetime import UTC, datetime
from pathlib import Path

import pytest
from pydantic import ValidationError
from sqlalchemy import make_url, text

from ensemble.store import Store, StoreError, StoreInputError, staging
from ensemble.store.sql_database import PLACE, Place, engine
from tests import postgresql
from tests.ensemble.catalog_conformance import CatalogConformance, boundary, made_with
from tests.ensemble.runs import assert_same_run, shear_run


def test_critical_value_is_the_geometric_mean_of_a_closed_bracket() -> None:
    assert boundary("a", 0.25, 1.0, datetime(2026, 1, 1, tzinfo=UTC)).points[0].critical_value == 0.5
    assert boundary("a", 0.25, None, datetime(2026, 1, 1, tzinfo=UTC)).points[0].critical_value is None
    with pytest.raises(ValidationError, match="bracket"):
        boundary("a", -1.0, 1.0, datetime(2026, 1, 1, tzinfo=UTC))


class TestSQLite(CatalogConformance):
    @pytest.fixture(scope="class")
    @classmethod
    def database(cls) -> None:
        return None

    def test_the_catalog_is_a_file_of_the_store(self, store: Store) -> None:
        assert (store.path / "catalog.sqlite").is_file()
        assert not (store.path / PLACE).exists()


class TestPostgreSQL(CatalogConformance):
    @pytest.fixture(scope="class")
    @classmethod
    def database(cls, postgresql_server: postgresql.Server) -> str:
        return postgresql_server.new_database()

    def test_the_store_keeps_the_url_to_itself(self, store: Store) -> None:
        assert not (store.path / "catalog.sqlite").exists()
        assert stat.S_IMODE((store.path / PLACE).stat().st_mode) == 0o600

    def test_stores_that_share_a_database_keep_apart(
        self, store: Store, database: str, tmp_path: Path
    ) -> None:
        with made_with(database, tmp_path / "other") as other:
            key = other.save(shear_run())
            assert not store.contains(key)
            store.save(shear_run())
            store.recover()
            assert other.check() == []

    def test_a_store_whose_database_is_lost_is_refused_and_left_alone(self, store: Store) -> None:
        key = store.save(shear_run())
        place = Place.of(store.path)
        with engine(place.url).begin() as connection:
            connection.execute(text(f"DROP SCHEMA {place.schema_name} CASCADE"))
        for opening in (Store.open, Store.existing):
            with pytest.raises(StoreInputError, match="cannot be opened") as refused:
                opening(store.path)
            assert "\n" not in str(refused.value)
        assert (store.path / "runs" / key).is_dir()

    def test_a_renamed_role_is_taken_from_the_environment(
        self, store: Store, database: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Costs 1 s.
        key = store.save(shear_run())
        kept = make_url(Place.of(store.path).url)
        lost = kept.set(username="renamed").render_as_string(hide_password=False)
        Place(url=lost, schema_name=Place.of(store.path).schema_name).keep(store.path)
        with pytest.raises(StoreInputError, match="renamed"):
            Store.existing(store.path)
        monkeypatch.setenv("ENSEMBLE_DATABASE", database)
        with Store.existing(store.path) as opened:
            assert opened.contains(key)

    def test_a_creation_that_was_cut_short_is_completed(self, store: Store) -> None:
        for directory in ("runs", "staging"):
            shutil.rmtree(store.path / directory)
        with Store.open(store.path) as again:
            assert again.summaries() == []


@pytest.mark.parametrize("url", ["nonsense", "nodatabase://here", "postgresql+psycopg://127.0.0.1:1/x"])
def test_a_database_that_cannot_be_used_makes_no_store(url: str, tmp_path: Path) -> None:
    with pytest.raises(StoreInputError, match=r"^store: .* cannot be opened") as refused:
        made_with(url, tmp_path / "store").__enter__()
    assert "\n" not in str(refused.value)
    with made_with(None, tmp_path / "store") as store:
        assert store.summaries() == []


def test_a_server_that_is_away_at_a_commit_costs_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    programs = postgresql.programs()
    if programs is None:
        pytest.skip("no PostgreSQL server: install the system's package")
    monkeypatch.setattr(staging, "DISK_SECONDS", 0.5)
    path = tmp_path / "store"
    with postgresql.running(programs) as server:
        with made_with(server.new_database(), path) as store:
            staged = store.stage(shear_run())
            server.stop()
            with pytest.raises(StoreError, match="it is kept in") as refused:
                store.commit(staged)
            assert "\n" not in str(refused.value)
        for opening in (Store.open, Store.existing):
            with pytest.raises(StoreInputError, match="cannot be opened"):
                opening(path)
        server.start()
        with Store.open(path) as store:
            assert_same_run(store.load(staged.key), shear_run())
            assert store.check() == []
