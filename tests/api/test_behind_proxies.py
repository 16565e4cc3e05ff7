"""The service behind a proxy that strips a prefix, and clients for which the environment names a proxy."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx2
import pytest
from playwright.sync_api import expect, sync_playwright

from api import client as client_module
from api.client import Client
from tests.api.servers import serving
from tests.api.stores import fill

PREFIX = "/department/vesicles"
HOP_BY_HOP = {"connection", "transfer-encoding", "content-length", "content-encoding"}


@contextmanager
def stripping_proxy(service: str) -> Iterator[str]:
    """Serve a service below a prefix that it does not know, and nothing beside it."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.forward()

        def do_POST(self) -> None:
            self.forward()

        def forward(self) -> None:
            if not self.path.startswith(f"{PREFIX}/"):
                self.send_error(404)
                return
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            headers = {name: value for name, value in self.headers.items() if name.lower() != "host"}
            address = service + self.path.removeprefix(PREFIX)
            answer = httpx2.request(self.command, address, headers=headers, content=body, timeout=30)
            self.send_response(answer.status_code)
            for name, value in answer.headers.items():
                if name not in HOP_BY_HOP:
                    self.send_header(name, value)
            self.send_header("Content-Length", str(len(answer.content)))
            self.end_headers()
            self.wfile.write(answer.content)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}{PREFIX}"
        server.shutdown()


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    store = tmp_path_factory.mktemp("proxied") / "store"
    fill(store)
    with serving(store) as service, stripping_proxy(service) as prefixed:
        yield prefixed


def test_addresses_in_answers_hold_behind_a_prefix(address: str) -> None:
    page = httpx2.get(f"{address}/runs", params={"limit": 1})
    keys = [page.json()["items"][0]["key"]]
    while page.json()["next"]:
        page = httpx2.get(page.url.join(page.json()["next"]))
        keys += [item["key"] for item in page.json()["items"]]
    assert sorted(keys) == sorted(item["key"] for item in httpx2.get(f"{address}/runs").json()["items"])
    assert len(keys) > 1
    submitted = httpx2.post(f"{address}/jobs", json={"preset": "doublet-shear"})
    job = httpx2.get(submitted.url.join(submitted.headers["location"]))
    assert job.json()["id"] == submitted.json()["id"]


def test_the_client_works_behind_a_prefix(address: str) -> None:
    with Client(address) as client:
        assert len(list(client.boundaries())) == 1
        assert client.submit("doublet-shear").status == "accepted"


def test_the_page_works_behind_a_prefix(address: str) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        page = browser.new_page()
        requested: set[str] = set()
        page.on("request", lambda request: requested.add(request.url))
        page.goto(f"{address}/")
        page.locator(".plot .main-svg").first.wait_for()
        page.goto(f"{address}/#/runs")
        expect(page.get_by_role("heading", level=1)).to_contain_text("Runs")
        page.locator("table tbody tr").first.wait_for()
        browser.close()
    assert requested
    assert {url for url in requested if not url.startswith((address, "data:", "blob:"))} == set()


def test_no_proxy_is_used_for_this_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("http_proxy", "all_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:1")  # nobody listens there
    with serving(tmp_path / "store") as service, Client(service) as client:
        assert list(client.boundaries()) == []


def test_an_error_names_the_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:1")
    monkeypatch.setattr(client_module.Client._request.retry, "stop", lambda _: True)  # type: ignore[attr-defined]
    with Client("http://vesicles.example") as client, pytest.raises(httpx2.TransportError) as raised:
        client.get("/healthz")
    assert "http://127.0.0.1:1" in " ".join(raised.value.__notes__)
