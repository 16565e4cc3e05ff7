"""The web page in a real browser, with a real service and a worker."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import h5netcdf
import httpx2
import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, ConsoleMessage, Page, Response, expect, sync_playwright

from api.auth import TokenScope
from ensemble.config.documents import load, load_scene, load_study, preset_document, preset_names
from ensemble.config.outcome_map import OutcomeMap
from ensemble.config.run_key import run_key
from ensemble.report import PAGE, ReportName, report_directory
from ensemble.report.report_page import report_page
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.map_record import MapRecord, MapRunRecord
from ensemble.store import Store
from solver import Simulation
from solver.analysis.run import Outcome, Run
from solver.flows import FLOWS
from solver.scene import Units
from tests.api.processes import wait_until
from tests.api.servers import make_token, serving
from tests.api.services import service, start_service
from tests.api.stores import example_boundary
from tests.ensemble.runs import shear_run, shear_scene
from tests.solver.restarts import PAIR

# The default of 5 s is too short on a busy machine.
expect.set_options(timeout=30_000)

WIDE, NARROW = {"width": 1400, "height": 900}, {"width": 390, "height": 844}
EARLIER = datetime(2026, 1, 1, tzinfo=UTC)
VIEWS = {
    "/": "Critical Hamaker constant against shear rate",
    "/#/runs": "Runs",
    "/#/jobs": "Jobs",
    "/#/new?preset=doublet-shear": "New job",
}
# Records what the Content-Security-Policy blocks.
RECORD_VIOLATIONS = """
window.violations = [];
document.addEventListener("securitypolicyviolation", ({ effectiveDirective, blockedURI, sourceFile }) =>
    window.violations.push(`${effectiveDirective} ${blockedURI} ${sourceFile}`));
"""
UNITS = {
    "radius R that is the unit of length": "10 um",
    "bending modulus κ that is the unit": "1e-19 J",
    "viscosity μ of the fluid": "1 mPa*s",
}
QUICK_STUDY = {
    "values of the shear rate": "0.5",
    "relative width of a bracket": "0.025",
    "points on each vesicle": "36",
    "tolerance in time": "1e-4",
}


@pytest.fixture(scope="module")
def store(finished_study: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A traced boundary and its runs."""
    return Path(shutil.copytree(finished_study.store, tmp_path_factory.mktemp("page") / "store"))


@pytest.fixture(scope="module")
def run(store: Path) -> Run:
    """A run in which the doublet stays together."""
    with Store.existing(store) as opened:
        return opened.load(opened.summaries(["outcome=bound"])[0].key)


@pytest.fixture(scope="module")
def url(store: Path) -> Iterator[str]:
    """Address of a service with a worker."""
    with service(store) as started:
        yield started.url


@pytest.fixture(scope="module")
def boundary(finished_study: Any) -> str:
    """Address of the boundary, relative to that of the service."""
    with Store.existing(finished_study.store) as opened:
        return f"/#/boundaries/{opened.boundaries()[0].study_key}"


@pytest.fixture(scope="module")
def run_path(run: Run) -> str:
    return f"/#/runs/{run_key(run.scene)}"


@pytest.fixture(scope="module")
def job_path(url: str) -> str:
    job = httpx2.post(f"{url}/jobs", json={"preset": "doublet-shear", "set": {"horizon": 0.4}}).json()
    return f"/#/jobs/{job['id']}"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        # If the system has none, the one that playwright has installed.
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A wide page, in which no script may fail."""
    with browser.new_context(viewport=WIDE) as context:
        opened = context.new_page()
        failures: list[str] = []
        opened.on("pageerror", lambda error: failures.append(str(error)))
        yield opened
        assert not failures


def assert_accessible(page: Page) -> None:
    """What axe-core checks: contrast, names, roles, labels, landmarks, headings."""
    page.evaluate("document.querySelectorAll('details').forEach(part => part.open = true)")
    found = Axe().run(page).response["violations"]
    assert [(each["id"], [node["target"] for node in each["nodes"]]) for each in found] == []


def count(page: Page, outcome: str) -> int:
    """Return the number of marks of an outcome in the diagram."""
    traces = page.locator(".diagram").evaluate("plot => plot.data")
    return sum(len(trace["x"]) for trace in traces if trace.get("name") == outcome)


def widths(page: Page) -> list[float]:
    """Return the widths of the drawn brackets."""
    page.locator(".diagram .main-svg").first.wait_for()
    traces = page.locator(".diagram").evaluate("plot => plot.data")
    return [2 * half for trace in traces for half in trace.get("error_y", {}).get("array", [])]


def picture(page: Page) -> str:
    """Return the image on the player's canvas."""
    return str(page.locator(".player canvas").evaluate("canvas => canvas.toDataURL()"))


def clock(page: Page) -> float:
    return float(page.locator(".player .clock").inner_text().removeprefix("t = "))


def across(page: Page) -> float:
    """Return the horizontal position of the line in the plots."""
    box = page.locator(".cursor").bounding_box()
    assert box is not None
    return box["x"]


@pytest.mark.long  # 60 s
def test_a_submitted_study_is_shown_while_its_brackets_close(page: Page, url: str) -> None:
    page.goto(f"{url}/#/new?preset=critical-hamaker")
    expect(page.get_by_text("At most 102 runs")).to_be_visible()
    page.get_by_label("points on each vesicle").fill("31")
    expect(page.get_by_role("alert")).to_contain_text("See the marked field")
    points = page.get_by_label("points on each vesicle")
    expect(points).to_have_attribute("aria-invalid", "true")
    expect(points).to_have_accessible_description(re.compile("must be a multiple of 2"))
    expect(page.get_by_role("button", name="Submit")).to_be_disabled()
    for label, value in QUICK_STUDY.items():
        page.get_by_label(label).fill(value)
    expect(page.get_by_text(re.compile("^At most [12][0-9] runs"))).to_be_visible()

    page.evaluate("window.isSamePage = true")
    errors: list[str] = []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.get_by_role("button", name="Submit").click()
    page.wait_for_url("**/#/jobs/*")
    drawn: list[list[float]] = []
    page.locator(".diagram .main-svg").first.wait_for(timeout=60_000)
    succeeded = page.locator(".job-status", has_text="succeeded")
    failed = page.locator(".job-status", has_text="failed")
    while not succeeded.is_visible():
        assert not failed.is_visible()
        drawn.append(widths(page))
        page.wait_for_timeout(50)
    expect(page.get_by_text("complete", exact=True)).to_be_visible()
    assert page.evaluate("window.isSamePage")
    assert errors == []
    last = widths(page)
    assert len(last) == 1
    assert max(max(each) for each in drawn if each) > 1.5 * max(last)
    # The page shows what the service answers.
    job = httpx2.get(f"{url}/jobs").json()["items"][0]
    points = httpx2.get(f"{url}/boundaries/{job['key']}").json()["points"]
    assert sorted(last) == pytest.approx(
        sorted(point["bracket"][1] - point["bracket"][0] for point in points)
    )
    assert count(page, "bound") + count(page, "separated") == len(
        {run for point in points for run in point["runs"]}
    )


def test_a_mark_in_the_diagram_leads_to_its_run(page: Page, url: str, boundary: str) -> None:
    page.goto(url + boundary)
    marks = page.locator(".diagram .scatterlayer .point")
    marks.first.wait_for()
    # The highest mark, a bound pair, has no other one beneath it; those beside the bracket overlap.
    heights = [box["y"] for mark in marks.all() if (box := mark.bounding_box())]
    marks.nth(heights.index(min(heights))).hover(force=True)
    page.mouse.down()
    page.mouse.up()
    page.wait_for_url("**/#/runs/*")
    expect(page.get_by_role("heading", level=1)).to_contain_text(Outcome.BOUND)


def test_the_runs_of_a_diagram_are_reached_by_keys(page: Page, url: str, boundary: str, store: Path) -> None:
    page.goto(url + boundary)
    page.locator(".diagram .main-svg").first.wait_for()
    page.get_by_role("application").focus()
    page.keyboard.press("Home")
    label = page.locator(".diagram .hoverlayer .hovertext")
    expect(label).to_contain_text("separated")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("End")
    status = page.get_by_role("status").filter(has_text="bound, γ̇ =")
    expect(status).to_contain_text(re.compile("period .*, gap .*, area error .*, spatial error"))
    page.keyboard.press("Enter")
    page.wait_for_url("**/#/runs/*")
    with Store.existing(store) as opened:
        highest = opened.boundary(boundary.split("/")[-1]).points[-1]
        runs = [opened.summary(key) for key in highest.runs]
    last = max(runs, key=lambda run: run.scene.adhesion.hamaker)
    assert page.url.endswith(last.key)


def test_the_ends_of_a_bracket_lead_to_their_runs(page: Page, url: str, boundary: str) -> None:
    page.goto(url + boundary)
    page.get_by_role("table", name="Points of the boundary").get_by_role("link").first.click()
    expect(page.get_by_role("heading", level=1)).to_contain_text(Outcome.SEPARATED)


def test_two_boundaries_on_one_diagram(page: Page, url: str, boundary: str, store: Path) -> None:
    study = load_study("critical-hamaker", ["search.tolerance=0.03"])
    outcomes, status, bracket = (Outcome.SEPARATED, Outcome.BOUND), "converged", (0.4, 0.41)
    points = [
        BoundaryPoint(
            parameters={"flow.rate": rate},
            bracket=bracket,
            outcomes=outcomes,
            status=status,
            certified=certified,
            runs=[],
        )
        for rate, certified in ((0.5, True), (1.0, False))
    ]
    with Store.open(store) as opened:
        opened.save_boundary(
            Boundary(
                study_key=study.key,
                study=study.model_dump(mode="json"),
                name=study.name,
                points=points,
                updated=EARLIER,
            )
        )
    page.goto(url + boundary)
    drawn = widths(page)
    page.get_by_label("Draw with").select_option(study.name)
    page.wait_for_url(f"**?with={study.key}")
    page.locator(".diagram .main-svg").first.wait_for()
    assert sorted(widths(page)) == pytest.approx(sorted([*drawn, 0.01, 0.01]))
    expect(page.locator(".diagram .legend")).to_contain_text(study.name)
    # Of its own, with the certified bracket drawn thicker.
    page.goto(f"{url}/#/boundaries/{study.key}")
    expect(page.locator(".diagram .legend")).to_contain_text("certified bracket")
    traces = page.locator(".diagram").evaluate("plot => plot.data")
    bars = {trace["x"][0]: trace["error_y"]["thickness"] for trace in traces if "error_y" in trace}
    assert bars[0.5] > 2 * bars[1.0]


def test_a_surface_is_curves_and_a_map_and_is_read_at_two_values(page: Page, url: str, store: Path) -> None:
    study = load_study("critical-hamaker-surface")
    points = [
        BoundaryPoint(
            parameters=dict(zip(study.swept, (rate, area), strict=True)),
            bracket=(rate * area / 1.01, rate * area * 1.01),
            outcomes=("separated", "bound"),
            status="converged",
            certified=False,
            runs=[],
        )
        for rate, area in study.places
    ]
    with Store.open(store) as opened:
        opened.save_boundary(
            Boundary(
                study_key=study.key,
                study=study.model_dump(mode="json"),
                name=study.name,
                points=points,
                updated=EARLIER,
            )
        )
    page.goto(f"{url}/#/boundaries/{study.key}")
    expect(page.get_by_role("heading", level=1)).to_have_text(
        "Critical Hamaker constant against shear rate and reduced area"
    )
    expect(page.locator(".diagram .scatterlayer .trace")).to_have_count(2)
    expect(page.locator(".contourlayer .contour")).to_have_count(1)
    expect(page.locator(".diagram .legendtext").first).to_contain_text("ΔA = 0.8")
    page.get_by_role("spinbutton", name="At shear rate").fill("0.75")
    page.get_by_role("spinbutton", name="and reduced area").fill("0.85")
    page.get_by_role("button", name="Read").click()
    expect(page.get_by_text(f"{0.75 * 0.85:.4g}", exact=True)).to_be_visible()
    page.goto(f"{url}/#/new?preset=critical-hamaker-surface")
    expect(page.get_by_label("values of the reduced area")).to_have_value(re.compile("0.8.*0.9"))


def test_a_map_is_shown_and_a_dot_leads_to_its_run(page: Page, url: str, store: Path, run: Run) -> None:
    question = load(OutcomeMap, "shear-hamaker-map", {"axes.resolution": 0.5})
    record = MapRecord(
        key=question.key,
        name=question.name,
        map=question.model_dump(mode="json"),
        labels=["bound", "separated"],
        cells=[[0, 0], [1, 1]],
        runs=[MapRunRecord(cell=(0, 1), run=run_key(run.scene))],
        updated=EARLIER,
    ).in_units(Units(radius="10 um", bending_modulus="1e-19 J", viscosity="1 mPa*s"))
    page.goto(f"{url}/#/maps")
    expect(page.get_by_role("link", name="Draw the first one")).to_be_visible()
    with Store.open(store) as opened:
        opened.save_map(record)
    page.goto(f"{url}/#/maps/{record.key}")
    expect(page.get_by_role("heading", level=1)).to_have_text("Outcome over shear rate and Hamaker constant")
    expect(page.locator(".heatmaplayer image")).to_have_count(1)
    expect(page.locator(".diagram")).to_contain_text("shear rate γ̇ (1/s)")
    regions = page.locator(".diagram").evaluate("plot => plot.data[0]")
    assert regions["x"] == pytest.approx([0.02, 0.09, 0.16])
    expect(page.get_by_role("table", name="Shares of the map")).to_contain_text("50 %")
    dot = page.locator(".scatterlayer .point").first.bounding_box()
    assert dot is not None
    page.mouse.click(dot["x"] + dot["width"] / 2, dot["y"] + dot["height"] / 2)
    page.wait_for_url(f"**/runs/{run_key(run.scene)}**")
    page.goto(f"{url}/#/maps/{16 * '0'}")
    expect(page.get_by_role("link", name="Back to maps")).to_be_visible()


def test_the_name_of_a_study_is_not_interpreted_as_html(page: Page, url: str, store: Path) -> None:
    study = load_study("critical-hamaker")
    name = "<img src=x onerror=alert(1)>"
    traced = Boundary(
        study_key=study.key, study=study.model_dump(mode="json"), name=name, points=[], updated=EARLIER
    )
    with Store.open(store) as opened:
        opened.save_boundary(traced)
    page.goto(f"{url}/#/boundaries/{study.key}")
    expect(page.get_by_text(name).first).to_be_visible()
    assert page.locator("main img").count() == 0


def test_a_run_is_played_with_canvas_and_plots_in_step(page: Page, url: str, run_path: str, run: Run) -> None:
    page.goto(url + run_path)
    page.locator(".histories .main-svg").first.wait_for()
    start = picture(page)
    page.get_by_role("button", name="Play").click()
    wait_until(lambda: clock(page) > 3)
    page.get_by_role("button", name="Pause").click()
    stopped = clock(page)
    assert picture(page) != start
    line = across(page)
    page.locator(".player canvas").press("Home")
    start_line = across(page)
    page.locator(".player canvas").press("End")
    share = (line - start_line) / (across(page) - start_line)
    assert share == pytest.approx(stopped / run.frames.time[-1], abs=0.005)
    axes = page.locator(".histories .nsewdrag").first.bounding_box()
    assert axes is not None
    assert (start_line, across(page)) == pytest.approx((axes["x"], axes["x"] + axes["width"]), abs=1.5)
    # The address is a link to this moment.
    page.get_by_role("slider", name="Time").fill(str(stopped))
    page.get_by_role("button", name="Next frame").click()
    moment = run.frames.time[run.frames.time > stopped][0]
    page.wait_for_url(f"**time={moment:.2f}")
    shown = picture(page)
    page.reload()
    wait_until(lambda: page.locator(".player canvas").count() and picture(page) == shown, seconds=20)
    assert clock(page) == moment


def test_arrows_follow_the_rate_of_the_flow(page: Page, url: str) -> None:
    """They grow, vanish and turn round with a rate that changes; 2 s."""
    page.goto(url)
    strengths = page.evaluate(
        """async () => {
            const { ImposedFlow } = await import(document.scripts[0].src.replace('main', 'flow'));
            const velocity = [[[0, 0], [1, 1]], [[0, 0], [0, 0]]];
            const still = new ImposedFlow({ x: [0, 1], y: [0, 1], velocity });
            const moving = still.during({ time: [0, 1, 2, 3], flow_rate: [0, -1, -1, 0.5] }, -0.5);
            return [...[0, 0.5, 1, 2.5, 3, 4].map((time) => moving.strength(time)), still.strength(7)];
        }"""
    )
    assert strengths == pytest.approx([0.0, 0.5, 1.0, 0.25, -0.5, -0.5, 1.0])


def test_the_player_obeys_the_keyboard(page: Page, url: str, run_path: str, run: Run) -> None:
    times = [round(time, 1) for time in run.frames.time.tolist()]
    page.goto(url + run_path)
    page.locator(".player canvas").focus()
    page.keyboard.press("End")
    assert clock(page) == times[-1]
    page.keyboard.press("ArrowLeft")
    assert clock(page) == times[-2]
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    assert clock(page) == times[1]
    play, pause = (page.get_by_role("button", name=name) for name in ("Play", "Pause"))
    page.keyboard.press(" ")
    expect(pause).to_be_visible()
    page.keyboard.press(" ")
    expect(play).to_be_visible()
    # Wherever the focus is, also after a click on another button, unless the space is for that.
    page.get_by_role("link", name="Run again with changes").focus()
    page.keyboard.press(" ")
    expect(pause).to_be_visible()
    page.get_by_role("button", name="Previous frame").click()
    page.keyboard.press(" ")
    expect(pause).to_be_visible()
    page.get_by_role("button", name="Previous frame").press(" ")
    expect(play).to_be_visible()
    page.get_by_role("slider", name="Time").fill("7.5")
    assert clock(page) == 7.5


def test_curves_between_points_are_those_of_the_fourier_coefficients(page: Page, url: str) -> None:
    page.goto(url)
    script = """async ([values, factor]) => {
        const { refined } = await import(document.scripts[0].src.replace('main', 'trigonometric'));
        return [...refined(Float32Array.from(values), factor)];
    }"""

    def curve(points: int) -> Any:
        s = 2 * np.pi * np.arange(points) / points
        return 1.5 + np.cos(3 * s - 0.4) - 2 * np.sin(7 * s) + np.cos(8 * s)

    for factor in (1, 4, 8):
        answer = page.evaluate(script, [curve(16).tolist(), factor])
        np.testing.assert_allclose(answer, curve(16 * factor), atol=3e-6)


def test_states_between_frames_are_cubic(page: Page, url: str) -> None:
    page.goto(url)
    weights = """async time => {
        const { hermiteWeights } = await import(document.scripts[0].src.replace('main', 'frames'));
        return hermiteWeights([0, 1, 2, 3], time);
    }"""
    for time in (1.0, 1.25, 1.9):
        values = page.evaluate(weights, time)
        assert sum(values) == pytest.approx(1)
        assert sum(value * at**2 for at, value in enumerate(values)) == pytest.approx(time**2)


def test_the_flow_is_known_between_and_beyond_the_places_where_it_was_sampled(
    page: Page, url: str, run: Run
) -> None:
    page.goto(url)
    velocities = """async ([key, places]) => {
        const { ImposedFlow } = await import(document.scripts[0].src.replace('main', 'flow'));
        const flow = await ImposedFlow.of(key, new AbortController().signal);
        return places.map(([x, y]) => flow.at(x, y));
    }"""
    places = [[0.3, -0.7], [2.1, 1.9], [-40.0, 55.0]]
    answer = page.evaluate(velocities, [run_key(run.scene), places])
    assert run.scene.flow is not None
    expected = run.scene.flow.velocity(np.transpose(places), run.frames.center[0].T)
    np.testing.assert_allclose(np.transpose(answer), expected, atol=1e-12)


def test_a_run_in_progress_is_watched_until_it_is_done(page: Page, url: str, store: Path) -> None:
    with Store.open(store) as opened:
        checkpoint = opened.checkpoint(PAIR)
        simulation = Simulation(PAIR, sink=checkpoint.record)
        page.goto(f"{url}/#/runs/{checkpoint.key}")
        expect(page.get_by_text("shown from its first checkpoint on")).to_be_visible()
        while simulation.time < PAIR.horizon / 2:
            simulation.step()
        checkpoint.write(simulation.saved())
        page.reload()
        expect(page.get_by_role("heading", name="In progress")).to_be_visible()
        expect(page.get_by_text(f"of {PAIR.horizon:g} at the latest")).to_be_visible()
        page.locator(".plot .main-svg").first.wait_for()
        opened.commit(opened.stage_recorded(simulation.finish(), checkpoint.record))
        expect(page.get_by_role("heading", name="Undecided")).to_be_visible(timeout=60_000)
        page.locator("canvas").first.wait_for()


def test_a_long_run_is_fetched_in_several_requests(page: Page, url: str, run: Run) -> None:
    page.goto(url)
    summary = httpx2.get(f"{url}/runs/{run_key(run.scene)}").json()
    frames = """async ([run, most]) => {
        const { Frames } = await import(document.scripts[0].src.replace('main', 'frames'));
        const { states } = await Frames.of(run, new AbortController().signal, most);
        return states.map(({ time, membranes }) => [time, membranes[1].tension.at(-1)]);
    }"""
    whole = page.evaluate(frames, [summary, 500_000])
    assert [time for time, _ in whole] == pytest.approx(run.frames.time.tolist())
    assert page.evaluate(frames, [summary, 5000]) == whole


def test_of_a_long_run_some_records_are_fetched(page: Page, url: str, run: Run) -> None:
    page.goto(url)
    series = """async ([key, most]) => {
        const { seriesOf } = await import(document.scripts[0].src.replace('main', 'series'));
        return (await seriesOf(`/runs/${key}`, new AbortController().signal, most)).time;
    }"""
    times = run.series["time"].tolist()
    assert page.evaluate(series, [run_key(run.scene), 500_000]) == pytest.approx(times)
    a_third = math.ceil(len(times) * len(run.series) / 3)
    assert page.evaluate(series, [run_key(run.scene), a_third]) == pytest.approx(times[::3])


def test_scripts_are_loaded_once_and_kept(page: Page, url: str) -> None:
    """Their addresses contain a digest, so a browser may keep them for ever."""
    scripts: list[Response] = []
    page.on("response", lambda answer: scripts.append(answer) if "/assets/" in answer.url else None)
    page.goto(url)
    page.locator(".plot .main-svg").first.wait_for()
    assert len(scripts) > 10
    for script in scripts:
        assert script.headers["cache-control"] == "public, max-age=31536000, immutable", script.url
    assert httpx2.get(f"{url}/assets/{'0' * 16}/main.js").status_code == 404
    assert httpx2.get(url).headers["cache-control"] == "no-cache"


def estimated_after(page: Page, change: Callable[[], None]) -> Any:
    """Change a form, and return what the service then estimates."""
    with page.expect_response("**/estimate") as answer:
        change()
    return answer.value.json()


def test_any_field_may_be_changed(page: Page, url: str) -> None:
    page.goto(f"{url}/#/new?preset=suspension-shear")
    expect(page.get_by_text("One run on one process; how long it takes is known after")).to_be_visible()
    count = page.get_by_label("number of vesicles")
    assert estimated_after(page, lambda: count.fill("40"))["cost"] == 64 * 40 * 20.0
    page.goto(f"{url}/#/new?preset=doublet-unequal")
    page.get_by_text("more parameters").click()
    further = page.get_by_label("any other change")
    further.fill("vesicles.0.viscosity_contrast = 4\nadhesion.cutoff = 0.1\n")
    expect(page.get_by_role("alert")).to_contain_text("cutoff must be more than the distance 0.2, got 0.1")
    changes = "vesicles.0.viscosity_contrast = 4\nadhesion.cutoff = 1.5"
    assert estimated_after(page, lambda: further.fill(changes))["cost"] == 8 * 64 * 2 * 4800.0
    further.fill("numerics.pionts = 64")
    expect(page.get_by_role("alert")).to_contain_text("numerics.pionts")


def test_flow_potential_and_integrator_are_chosen_from_menus(page: Page, url: str) -> None:
    """Their fields are those of the chosen kind, with help and units from the models."""
    page.goto(f"{url}/#/new?preset=doublet-quiescent")
    flow = page.get_by_label("imposed flow")
    expect(flow).to_have_value("none")
    kinds = [each.model_fields["kind"].default for each in FLOWS]
    assert flow.locator("option").all_inner_texts() == ["none", *kinds]
    flow.select_option("shear")
    rate = page.get_by_label("shear rate γ̇ in μ⁻¹R⁻³κ")
    expect(rate).to_have_accessible_description(re.compile("velocity gradient.*flow.rate", re.DOTALL))
    expect(rate).to_have_attribute("aria-invalid", "true")  # it has no usual value
    expect(rate).to_have_accessible_description(re.compile("must be a valid number"))
    rate.fill("0.5")
    expect(page.get_by_role("button", name="Submit")).to_be_enabled()
    page.get_by_label("adhesion potential").select_option("none")
    expect(page.get_by_label("Hamaker constant")).to_have_count(0)
    page.get_by_label("integrator").select_option("rosenbrock")
    expect(page.get_by_role("button", name="Submit")).to_be_enabled()
    with page.expect_request("**/jobs") as sent:
        page.get_by_role("button", name="Submit").click()
    assert sent.value.post_data_json["set"] == {
        "flow": {"kind": "shear", "rate": 0.5},
        "adhesion": None,
        "numerics.integrator": "rosenbrock",
    }
    page.wait_for_url("**/#/jobs/*")
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator(".job-status")).to_contain_text("canceled")
    # Again the same, or with changes.
    before = page.url
    page.get_by_role("button", name="Submit again").click()
    page.wait_for_url(lambda address: "/jobs/" in address and address != before)
    page.get_by_role("button", name="Cancel").click()
    first, again = (httpx2.get(f"{url}/jobs/{each.split('/')[-1]}").json() for each in (before, page.url))
    assert (again["key"], again["ranks"], again["seconds"]) == (
        first["key"],
        first["ranks"],
        first["seconds"],
    )
    page.get_by_role("link", name="Submit with changes").click()
    expect(page.get_by_label("imposed flow")).to_have_value("shear")
    expect(page.get_by_role("button", name="Submit")).to_be_enabled()


def test_a_number_that_is_refused_leads_to_what_it_needs(page: Page, url: str) -> None:
    page.goto(f"{url}/#/new?preset=doublet-shear")
    rate = page.get_by_label("shear rate γ̇")
    rate.fill("0,5")
    expect(rate).to_have_accessible_description(re.compile("write a decimal point: '0.5'"))
    radius = page.get_by_label("radius R that is the unit of length")
    expect(radius).not_to_be_visible()
    rate.fill("0.05 1/s")
    expect(rate).to_have_accessible_description(re.compile("units.radius .* and units.viscosity"))
    expect(radius).to_be_visible()
    expect(radius).to_have_accessible_description(re.compile("see shear rate"))
    for label, value in UNITS.items():
        page.get_by_label(label).fill(value)
    expect(page.get_by_role("button", name="Submit")).to_be_enabled()


def test_numbers_are_shown_with_their_units(page: Page, url: str, store: Path) -> None:
    units = Units(radius="10 um", bending_modulus="1e-19 J", viscosity="1 mPa*s")
    run = shear_run(shear_scene(rate=0.7).model_copy(update={"units": units}))
    boundary = example_boundary().in_units(units).model_copy(update={"study_key": "0123456789abcdef"})
    with Store.open(store) as opened:
        key = opened.save(run)
        opened.save_boundary(boundary)
    page.goto(f"{url}/#/runs/{key}")
    results = page.locator(".results")
    expect(results).to_contain_text(f"{run.gap:.4g} ({10 * run.gap:.4g} µm)")
    expect(results).to_contain_text(f"Period{run.period:.4g} ({10 * run.period:.4g} s)")
    page.locator(".histories .main-svg").first.wait_for()
    expect(page.locator(".histories")).to_contain_text("gap (µm)")
    traces = page.locator(".histories .plot").evaluate("plot => plot.data")
    assert traces[0]["x"] == pytest.approx((10 * run.series["time"]).tolist())
    assert traces[0]["y"] == pytest.approx((10 * run.series["gap"]).tolist())
    page.locator(".player canvas").press("End")
    assert page.locator(".player .clock").inner_text() == "t = 9.0 (90.0 s)"
    page.goto(f"{url}/#/boundaries/{boundary.study_key}")
    expect(page.locator(".diagram")).to_contain_text("shear rate γ̇ (1/s)")
    low, high = (100 * end for end in boundary.points[1].bracket)
    expect(page.get_by_role("table", name="Points")).to_contain_text(f"({low:.2f} – {high:.2f} µPa)")
    page.get_by_label("At shear rate γ̇ in 0.1 1/s").fill("0.5")
    page.get_by_role("button", name="Read").click()
    expect(page.locator("dd").first).to_contain_text("µPa)")


def test_a_protocol_of_the_rate_is_chosen_from_a_menu(page: Page, url: str) -> None:
    """A scene without one does not have the field at all."""
    page.goto(f"{url}/#/new?preset=vesicle-shear")
    protocol = page.get_by_label("change of the rate with time")
    expect(protocol).to_have_value("none")
    protocol.select_option("ramp")
    page.get_by_label("duration in μR³κ⁻¹").fill("20")
    with page.expect_request("**/jobs") as sent:
        page.get_by_role("button", name="Submit").click()
    changed = sent.value.post_data_json["set"]["protocol"]
    assert (changed["kind"], changed["duration"]) == ("ramp", 20)
    page.wait_for_url("**/#/jobs/*")
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator(".job-status")).to_contain_text("canceled")


def test_addresses_without_a_view_lead_back(page: Page, url: str) -> None:
    for address, way in (("nowhere", "boundaries"), ("runs/" + 32 * "0", "runs"), ("jobs/none", "jobs")):
        page.goto(f"{url}/#/{address}")
        back = page.get_by_role("link", name=f"Back to {way}")
        expect(back).to_be_visible()
        assert_accessible(page)
        back.click()
        expect(page.locator("nav [aria-current]")).to_have_text(way.capitalize())


def test_every_preset_and_every_stored_scene_can_be_submitted_as_it_is(
    page: Page, url: str, store: Path
) -> None:
    """A stored scene is written in full, with nulls for what it does not have."""
    scenes = []
    with Store.open(store) as opened:
        for name in preset_names():
            if {"vesicles", "arrangement"} & set(preset_document(name)):
                scene = load_scene(name, ["numerics.points=32"])
                opened.commit(opened.stage(shear_run(scene)))
                scenes.append(run_key(scene))
    assert len(scenes) > 8
    for key in scenes:
        page.goto(f"{url}/#/runs/{key}")
        page.get_by_role("link", name="Run again with changes").click()
        expect(page.get_by_text(re.compile("^One run"))).to_be_visible()
        expect(page.get_by_role("button", name="Submit")).to_be_enabled()
    for name in preset_names():
        page.goto(f"{url}/#/new?preset={name}")
        expect(page.get_by_text(re.compile("^(One run|At most .* runs)"))).to_be_visible()
        expect(page.get_by_role("button", name="Submit")).to_be_enabled()


def test_runs_and_boundaries_are_saved_as_files(
    page: Page, url: str, run_path: str, run: Run, boundary: str, tmp_path: Path
) -> None:
    page.goto(url + run_path)
    with page.expect_download() as saved:
        page.get_by_role("group", name="Download").get_by_role("button", name="HDF5").click()
    saved.value.save_as(tmp_path / "run.h5")
    assert saved.value.suggested_filename == f"run-{run_key(run.scene)[:8]}.h5"
    with h5netcdf.File(tmp_path / "run.h5") as file:
        np.testing.assert_array_equal(file["gap"][:], run.series["gap"])
    page.goto(url + boundary)
    for button, beginning in (("CSV", b"flow.rate,critical adhesion.hamaker,"), ("figure", b"<?xml")):
        with page.expect_download() as saved:
            page.get_by_role("button", name=button, exact=True).click()
        assert saved.value.path().read_bytes().startswith(beginning)


def test_an_empty_store_says_so_and_has_a_beginning(page: Page, tmp_path: Path) -> None:
    with serving(tmp_path / "store") as url:
        page.goto(url)
        expect(page.locator("main")).to_contain_text("Nothing is stored yet.")
        assert_accessible(page)
        page.get_by_role("button", name="Trace the first boundary").click()
        expect(page.get_by_role("heading", level=1)).to_have_text("Critical hamaker")
        page.goto(f"{url}/#/runs")
        expect(page.locator("main")).to_contain_text("Nothing is stored yet.")
        page.get_by_role("button", name="Simulate a doublet in shear").click()
        expect(page.get_by_role("heading", level=1)).to_have_text("Doublet shear")
        jobs = httpx2.get(f"{url}/jobs").json()["items"]
        assert [job["name"] for job in jobs] == ["doublet-shear", "critical-hamaker"]


def test_a_report_is_shown_with_its_contents(page: Page, url: str, store: Path) -> None:
    page.goto(f"{url}/#/reports")
    expect(page.locator("main")).to_contain_text("Not made yet: ensemble report work-precision")
    directory = report_directory(store, ReportName.STABILITY)
    directory.mkdir(parents=True)
    text = "# Made up\n\n- It holds.\n\n" + "".join(f"## Part {i}\n\n{'text ' * 2000}\n\n" for i in (1, 2))
    (directory / PAGE).write_text(report_page(text, directory), encoding="utf-8")
    page.reload()
    assert_accessible(page)
    page.get_by_role("link", name="symmetry of bound pairs").click()
    report = page.frame_locator("iframe")
    report.get_by_role("link", name="Part 2").click()
    expect(report.get_by_role("heading", name="Part 2")).to_be_in_viewport()
    assert_accessible(page)


def test_a_job_is_canceled(page: Page, url: str) -> None:
    page.goto(f"{url}/#/jobs")
    work = {"preset": "doublet-shear", "set": {"criteria.revolutions": 1000, "horizon": 4e5}}
    job = httpx2.post(f"{url}/jobs", json=work).json()
    row = page.get_by_role("row").filter(has=page.locator(f"#job-{job['id']}"))
    expect(row).to_contain_text("running")
    row.get_by_role("button", name="Cancel").click()
    expect(row).to_contain_text("canceled")
    expect(row.get_by_role("button")).to_have_count(0)
    expect(row.get_by_role("link")).to_have_count(1)  # to the job: it has no result
    page.goto(f"{url}/#/jobs/{job['id']}")
    expect(page.locator("main")).to_contain_text("canceled")
    assert page.locator("main").inner_text().count("canceled") == 1
    assert httpx2.get(f"{url}/jobs/{job['id']}").json()["status"] == "dismissed"


def test_a_critical_value_is_read(page: Page, url: str, boundary: str, finished_study: Any) -> None:
    expected = finished_study.document["boundary"][1]["critical_value"]
    page.goto(url + boundary)
    page.get_by_label("At shear rate").fill("0.75")
    page.get_by_role("button", name="Read").click()
    expect(page.get_by_text(f"{expected:.4g}", exact=True)).to_be_visible()
    page.get_by_label("At shear rate").fill("9")
    page.get_by_role("button", name="Read").click()
    expect(page.get_by_role("alert")).to_contain_text("must lie within")


def test_runs_are_filtered(page: Page, url: str, store: Path) -> None:
    conditions = ["flow.rate>0.8", "adhesion.hamaker<2", "numerics.points=32"]
    with Store.existing(store) as opened:
        found = opened.summaries([*conditions, "outcome=bound"])
    page.goto(f"{url}/#/runs")
    page.get_by_label("Outcome").select_option("bound")
    page.get_by_label("Conditions").fill(", ".join(conditions))
    page.get_by_role("button", name="Filter").click()
    expect(page.locator("main").get_by_role("link", name=re.compile("^[0-9a-f]{8}$"))).to_have_count(
        len(found)
    )
    example = page.get_by_label("Conditions")
    page.set_viewport_size(NARROW)
    example.fill(str(example.get_attribute("placeholder")))
    assert example.evaluate("input => input.scrollWidth <= input.clientWidth"), "the example is cut"
    page.get_by_label("Conditions").fill("flow.speed>1")
    page.get_by_role("button", name="Filter").click()
    expect(page.get_by_role("alert")).to_contain_text("flow.speed")


def test_the_page_asks_for_a_token_if_one_is_required(page: Page, store: Path, tmp_path: Path) -> None:
    guarded = Path(shutil.copytree(store, tmp_path / "store"))
    token = make_token(guarded, "ada", TokenScope.READ, timedelta(hours=1))
    with serving(guarded) as url:
        page.goto(url)
        expect(page.get_by_role("dialog")).to_contain_text("requires a token")
        assert_accessible(page)
        page.get_by_label("Token", exact=True).fill("wrong")
        page.keyboard.press("Enter")
        expect(page.get_by_role("dialog")).to_contain_text("does not accept this token")
        page.get_by_label("Token", exact=True).fill(token)
        page.keyboard.press("Enter")
        expect(page.get_by_role("heading", level=1)).to_contain_text("Critical Hamaker constant")


@pytest.mark.parametrize(("viewport", "scheme"), [(WIDE, "light"), (NARROW, "dark")], ids=["wide", "narrow"])
def test_every_view_fits_keeps_its_policy_and_loads_nothing_from_elsewhere(
    browser: Browser,
    url: str,
    run_path: str,
    boundary: str,
    job_path: str,
    viewport: dict[str, int],
    scheme: str,
) -> None:
    messages: list[str] = []
    requested: set[str] = set()

    def note(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            messages.append(message.text)

    views = VIEWS | {run_path: Outcome.BOUND, boundary: VIEWS["/"], job_path: "Doublet shear"}
    with browser.new_context(viewport=viewport, color_scheme=scheme) as context:  # type: ignore[arg-type]
        page = context.new_page()
        page.add_init_script(RECORD_VIOLATIONS)
        page.on("console", note)
        page.on("request", lambda request: requested.add(request.url))
        for view, heading in views.items():
            page.goto(url + view)
            expect(page.get_by_role("heading", level=1)).to_contain_text(heading)
            if view in ("/", run_path, boundary):
                page.locator(".plot .main-svg").first.wait_for()
            assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"], view
            assert page.evaluate("violations") == [], view
            assert_accessible(page)
        background = "getComputedStyle(document.body).backgroundColor"
        channels = [int(value) for value in re.findall(r"\d+", page.evaluate(background))]
        assert (sum(channels) < 3 * 64) == (scheme == "dark")
        page.get_by_label("Colors").select_option("light" if scheme == "dark" else "dark")
        channels = [int(value) for value in re.findall(r"\d+", page.evaluate(background))]
        assert (sum(channels) < 3 * 64) == (scheme == "light")
    assert messages == []
    assert {address for address in requested if not address.startswith((url, "data:", "about:"))} == set()


def test_the_page_runs_no_script_but_its_own(page: Page, url: str) -> None:
    page.add_init_script(RECORD_VIOLATIONS)
    response = page.goto(url)
    assert response is not None
    directives = response.headers["content-security-policy"].split("; ")
    assert "script-src 'self'" in directives
    assert [directive.split()[0] for directive in directives if "unsafe" in directive] == ["style-src"]
    page.evaluate(
        "() => { const script = document.createElement('script'); script.textContent = 'window.isOwned = 1';"
        " document.body.append(script); }"
    )
    page.wait_for_function("violations.length > 0")
    assert [violation.split()[:2] for violation in page.evaluate("violations")] == [
        ["script-src-elem", "inline"]
    ]
    assert page.evaluate("window.isOwned") is None


@pytest.mark.long
def test_a_job_is_followed_across_a_restart_of_the_service(page: Page, tmp_path: Path) -> None:
    store = tmp_path / "store"
    first = start_service(store, "--workers=0")
    work = {"preset": "doublet-shear", "set": {"horizon": 4.0}}
    job = httpx2.post(f"{first.url}/jobs", json=work).json()
    page.goto(f"{first.url}/#/jobs/{job['id']}")
    expect(page.locator(".job-status")).to_contain_text("accepted")
    first.kill()
    with service(store, port=first.port):
        expect(page.locator(".job-status")).to_contain_text("succeeded", timeout=60_000)
        page.get_by_role("link", name="Run", exact=True).click()
        expect(page.get_by_role("heading", level=1)).to_contain_text(Outcome.UNDECIDED)
