"""Measures how much each view of the page loads, and when it shows something.

    python -m tests.benchmarks.page_weight STORE

The store has a boundary and runs. Each view is opened in a new browser, which has nothing of the page, and
once more in the same one. Browser and service are on one machine: the times are those of the page alone.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import Any, NamedTuple

from playwright.sync_api import Browser, Page, sync_playwright

from ensemble.store import Store
from tests.api.servers import serving

FIRST = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
NOW = "performance.now()"
VIEWPORT = {"width": 1280, "height": 900}


class Visit(NamedTuple):
    """What a visit took: requests, kilobytes, milliseconds to the first picture and to the last."""

    requests: int
    kilobytes: float
    first: float
    complete: float


def visit(page: Page, address: str, drawn: str) -> Visit:
    """Open a view, and wait until an element is there."""
    sizes: list[float] = []
    network = page.context.new_cdp_session(page)
    network.send("Network.enable")
    network.on("Network.loadingFinished", lambda event: sizes.append(event["encodedDataLength"]))
    page.goto(address)
    page.locator(drawn).first.wait_for()
    complete = page.evaluate(NOW)
    first = page.evaluate(FIRST)
    network.detach()
    return Visit(len(sizes), sum(sizes) / 1000, first, complete)


def measure(browser: Browser, address: str, drawn: str) -> tuple[Visit, Visit]:
    """Visit a view for the first time, and again."""
    with browser.new_context(viewport=VIEWPORT) as context:  # type: ignore[arg-type]
        visits: list[Any] = []
        for _ in range(2):
            page = context.new_page()
            visits.append(visit(page, address, drawn))
            page.close()
    return visits[0], visits[1]


def main() -> None:
    """Visit all views and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "store", type=Path, help="with a boundary and runs; it is served, and nothing changes"
    )
    options = parser.parse_args()
    with Store.existing(options.store) as store:
        views = {
            "boundary": (f"#/boundaries/{store.boundaries()[0].study_key}", ".diagram .main-svg"),
            "run": (f"#/runs/{store.summaries()[0].key}", ".histories .main-svg"),
            "runs": ("#/runs", "tbody tr"),
            "new job": ("#/new", "form.submit"),
        }
    print("view\tvisit\trequests\tkB\tfirst picture (ms)\tall drawn (ms)")
    with serving(options.store) as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        visit_address = f"{address}/"
        measure(browser, visit_address, "main")  # the service compresses its files once
        for name, (path, drawn) in views.items():
            for number, each in zip(
                ("first", "next"), measure(browser, visit_address + path, drawn), strict=True
            ):
                print(name, number, each.requests, *(f"{value:.0f}" for value in each[1:]), sep="\t")
        browser.close()


if __name__ == "__main__":
    main()
