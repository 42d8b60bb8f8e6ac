"""The panel in a real browser: the set-up, the bench, a run, two browsers, faults."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from .browser import launcher, open_page, shoot
from .panel_server import Served, served

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def launch() -> Iterator[Callable[[], Any]]:
    with launcher() as found:
        yield found


@pytest.fixture(scope="module")
def browser(launch: Callable[[], Any]) -> Iterator[Any]:
    found = launch()
    yield found
    found.close()


def free_controls(panel: Served) -> None:
    panel.command("take", over=True)
    panel.command("release")


def expect(locator: Any) -> Any:
    from playwright.sync_api import expect as of

    of.set_options(timeout=60_000)
    return of(locator)


def heading(page: Any, words: str) -> Any:
    return page.get_by_role("heading", name=re.compile(words))


def button(page: Any, name: str) -> Any:
    return page.get_by_role("button", name=name, exact=True)


def test_the_set_up_is_walked_from_nothing_to_a_dry_run(
    browser: Any, tmp_path: Path
) -> None:
    with served(tmp_path / "bench" / "rig.toml") as panel:
        page, watch = open_page(browser, panel.url)
        expect(page.get_by_text("the page Set up writes one")).to_be_visible()
        button(page, "For the computed bench (twin)").click()
        expect(heading(page, "Stage: port and settings")).to_be_visible()
        expect(page.get_by_role("row", name=re.compile("steps per mm"))).to_be_visible()
        shoot(page, "setup_stage")
        button(page, "Next step").click()
        button(page, "Home").click()
        button(page, "Home it").click()
        expect(page.locator("#setup-gap")).to_contain_text("149.0")
        page.get_by_label("The gauge, mm").fill("149")
        button(page, "Set the gap").click()
        expect(button(page, "Home, gauge, set the gap (done)")).to_be_visible()
        button(page, "Next step").click()
        page.get_by_label("Interlock (smallest gap), mm").fill("42,5")
        button(page, "Write into the rig file").click()
        expect(button(page, "Interlock (done)")).to_be_visible()
        button(page, "Next step").click()
        button(page, "Write into the rig file").click()
        expect(button(page, "Camera (done)")).to_be_visible()
        button(page, "Next step").click()
        button(page, "Lay the board under the camera").click()
        expect(page.locator("#board-look")).to_contain_text("24 of 24 corners")
        shoot(page, "setup_board")
        button(page, "Take the flat picture").click()
        button(page, "Calibrate").click()
        expect(page.get_by_text("px RMS, camera tilted")).to_be_visible()
        button(page, "Next step").click()
        page.get_by_label("Height of the rod's axis, mm").fill("0.9")
        button(page, "Set the height").click()
        expect(button(page, "Rod height, and which way is up (done)")).to_be_visible()
        button(page, "Specimen").click()
        button(page, "Take it").click()
        button(page, "Dry run (done)").click()
        expect(page.get_by_text("nothing was moved")).to_be_visible()
        expect(page.get_by_role("link", name="To the page Run")).to_be_visible()
        shoot(page, "setup_plan")
        text = (tmp_path / "bench" / "rig.toml").read_text()
        assert "min_gap_mm = 42.5" in text
        assert "# interlock: nothing nearer is ever sent to the stage" in text
        files = panel.panel.workspace.files()
        assert files.calibration is not None
        assert files.calibration.rod_height_mm == 0.9
        assert files.plan is not None
        assert watch.errors == []
        assert watch.hosts == {panel.netloc}
        page.context.close()


def test_theory_is_drawn_over_the_live_picture(browser: Any, panel: Served) -> None:
    page, watch = open_page(browser, f"{panel.url}#bench")
    free_controls(panel)
    if "homed" not in (page.locator(".chips").inner_text()):
        button(page, "Home").click()
        button(page, "Home it").click()
    expect(page.locator(".chips")).to_contain_text("homed")
    page.get_by_label("Go to a gap, mm").fill("60")
    page.keyboard.press("Enter")
    expect(page.locator("#gap-now")).to_have_text(re.compile(r"^60\.00"))
    magnet = page.get_by_role("row", name=re.compile("magnet, nominal"))
    # Below 0.5 mm once the rod is still: the hidden truth is not the nominal bench.
    misfit = magnet.get_by_role("cell").first
    expect(misfit).to_have_text(re.compile(r"^0\.[0-4]\d{2}$"))
    assert float(misfit.inner_text()) > 0.0
    assert page.evaluate(
        """() => { const over = document.querySelectorAll('canvas')[1];
        const data = over.getContext('2d').getImageData(0, 0, over.width, over.height);
        return data.data.some((value) => value > 0); }"""
    )
    shoot(page, "bench_desktop")
    page.get_by_label("Go to a gap, mm").fill("20")
    page.keyboard.press("Enter")
    expect(page.locator("#toasts")).to_contain_text("at least 40 mm")
    assert watch.errors == []
    assert watch.hosts == {panel.netloc}
    page.context.close()


def test_escape_stops_the_stage_from_a_page_that_only_watches(
    browser: Any, panel: Served
) -> None:
    free_controls(panel)
    mover, _ = open_page(browser, f"{panel.url}#bench")
    watcher, _ = open_page(browser, f"{panel.url}#bench", size="phone", dark=True)
    expect(mover.locator(".chips")).to_contain_text("homed")
    mover.get_by_label("Go to a gap, mm").fill("140")
    button(mover, "Go").click()
    expect(watcher.get_by_text("Watching · take over")).to_be_visible()
    expect(mover.locator(".chips")).to_contain_text("going to 140")
    watcher.keyboard.press("Escape")
    expect(mover.locator(".chips")).to_contain_text("idle")
    assert not mover.locator("#gap-now").inner_text().startswith("140")
    # Taking over is asked, and the other page is told.
    button(watcher, "Home").click()
    button(watcher, "Home it").click()
    expect(watcher.get_by_text("Take over the controls?")).to_be_visible()
    shoot(watcher, "phone_dark_take_over")
    button(watcher, "Take over").click()
    expect(mover.get_by_text("Watching · take over")).to_be_visible()
    expect(watcher.locator(".chips")).to_contain_text("idle")
    shoot(watcher, "bench_phone_dark")
    mover.context.close()
    watcher.context.close()


def test_what_is_typed_before_the_plan_has_come_is_not_written_over(
    browser: Any, panel: Served
) -> None:
    page, watch = open_page(browser, f"{panel.url}#run")
    plan, held = re.compile(r"/api/plan\?$"), []
    page.route(plan, lambda route: held.append(route))
    with page.expect_request(plan):
        page.reload()
    typed = page.get_by_label("Gaps, mm")
    typed.fill("70:60:-10")
    for route in held:
        route.continue_()
    expect(page.get_by_label("Name")).not_to_have_value("")
    expect(typed).to_have_value("70:60:-10")
    expect(page.get_by_text("nothing has moved")).to_be_visible()
    table = page.get_by_role("region", name="Plan", exact=True).get_by_role("rowheader")
    expect(table).to_have_count(2)
    assert watch.errors == []
    page.context.close()


def test_a_run_goes_on_when_its_browser_is_killed(
    launch: Callable[[], Any], browser: Any, panel: Served
) -> None:
    free_controls(panel)
    killed = launch()
    page, watch = open_page(killed, f"{panel.url}#run")
    page.get_by_label("Gaps, mm").fill("70:60:-10")
    expect(page.get_by_text("nothing has moved")).to_be_visible()
    button(page, "Start the run").click()
    expect(heading(page, "step 1 of 2")).to_be_visible()
    button(page, "Pause").click()
    expect(heading(page, "paused")).to_be_visible()
    shoot(page, "run_paused")
    button(page, "Go on").click()
    expect(heading(page, "paused")).to_be_hidden()
    assert watch.errors == []
    assert watch.hosts == {panel.netloc}
    killed.close()
    page, watch = open_page(browser, f"{panel.url}#run")
    expect(page.get_by_text("success: every step of the plan")).to_be_visible()
    expect(page.get_by_role("img", name="photograph at 60.0 mm")).to_be_visible()
    free_controls(panel)
    button(page, "Extract").click()
    expect(button(page, "Extract again")).to_be_visible()
    shoot(page, "run_extracted")
    page.goto(f"{panel.url}#runs")
    expect(page.get_by_role("row", name=re.compile("success")).first).to_be_visible()
    shoot(page, "runs")
    assert watch.errors == []
    page.context.close()


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ('kind = "camera stall"\nat_s = 0.5', "picture every"),
        ('kind = "meter overload"\nat_s = 0.5', "beyond its range"),
        ('kind = "alarm 1"\nat_gap_mm = 135.0', "ALARM:1"),
    ],
)
def test_a_fault_of_the_bench_is_named_on_the_page(
    browser: Any, bench: Path, tmp_path: Path, fault: str, sentence: str
) -> None:
    folder = tmp_path / "faulty"
    folder.mkdir()
    for name in ("plan.toml", "specimen.toml", "calibration.json"):
        (folder / name).write_bytes((bench.parent / name).read_bytes())
    text = bench.read_text() + f"\n[[twin.fault]]\n{fault}\n"
    (folder / "rig.toml").write_text(text)
    with served(folder / "rig.toml") as panel:
        page, watch = open_page(browser, f"{panel.url}#bench")
        if "camera" not in fault:
            button(page, "Home").click()
            button(page, "Home it").click()
            expect(page.locator(".chips")).to_contain_text("homed")
        if "alarm" in fault:
            page.get_by_label("Go to a gap, mm").fill("60")
            page.keyboard.press("Enter")
        expect(page.locator("#banners")).to_contain_text(sentence)
        assert watch.errors == []
        page.context.close()
