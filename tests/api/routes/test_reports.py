"""Reports over HTTP: those that have been made into the store."""

from __future__ import annotations

from ensemble.report import PAGE, ReportName, report_directory
from ensemble.report.report_page import report_page
from ensemble.store import Store
from tests.api.servers import client_of


def test_a_report_is_listed_and_given_once_it_is_made(tmp_path):
    with Store.open(tmp_path / "store") as store, client_of(store.path) as client:
        assert client.get("/reports").json() == {"items": [], "next": None}
        missing = client.get("/reports/stability")
        assert missing.status_code == 404
        assert "stability" in missing.json()["detail"]
        directory = report_directory(store.path, ReportName.STABILITY)
        directory.mkdir(parents=True)
        page = report_page("# Made up\n\n- It holds.\n", directory)
        (directory / PAGE).write_text(page, encoding="utf-8")
        assert [item["name"] for item in client.get("/reports").json()["items"]] == ["stability"]
        answer = client.get("/reports/stability")
        assert answer.text == page
        assert answer.headers["content-type"].startswith("text/html")
        assert "sandbox; default-src 'none'" in answer.headers["content-security-policy"]


def test_only_the_names_of_reports_are_looked_for(tmp_path):
    with Store.open(tmp_path / "store") as store, client_of(store.path) as client:
        assert client.get("/reports/..%2f..%2fetc").status_code in {404, 422}
        assert client.get("/reports/unknown").status_code == 422
