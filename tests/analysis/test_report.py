"""The page: self-contained, honest about failures, light, and clean in a browser."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
from analysis_factory import write_run

from magbend import sim
from magbend.analysis import compare_run, fit_runs, load_run, write_report
from magbend.analysis.compare.compare import RunComparison
from magbend.analysis.fit.runs import try_fit
from magbend.analysis.report.budget import ASSUMED, tip_budget
from magbend.analysis.report.build import number
from magbend.core.errors import StoreError

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def photograph() -> bytes:
    """Return a PNG of 1600 x 1200 with noise, as heavy as a real one."""
    rng = np.random.default_rng(0)
    picture = rng.normal(200, 6, (1200, 1600, 3)).clip(0, 255).astype(np.uint8)
    cv2.line(picture, (800, 400), (1400, 330), (30, 30, 30), 20)
    return cv2.imencode(".png", picture)[1].tobytes()


def compared(path: Path, **kwargs: object) -> RunComparison:
    return compare_run(load_run(write_run(path, **kwargs)))  # type: ignore[arg-type]


class Page(HTMLParser):
    """Collects what a page would fetch, its tags and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.tags: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            if name in ("src", "href", "xlink:href", "srcset", "action", "data"):
                self.links.append(value or "")

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory, photograph: bytes) -> Path:
    """Return the report of a run whose second photograph failed."""
    path = tmp_path_factory.mktemp("single") / "run"
    run = compared(path, sigma_mm=0.01, failed=[1], image=photograph)
    write_report([run], path / "report.html", fits=[fit_runs([run.run])])
    return path / "report.html"


def test_page_fetches_nothing(single: Path) -> None:
    page = Page(single.read_text())
    assert page.links
    assert all(link.startswith(("data:", "#")) for link in page.links)
    text = single.read_text()
    assert "@import" not in text
    assert not re.search(r"url\((?!#|data:)", text)


def test_failed_frame_is_said_loudly(single: Path) -> None:
    page = Page(single.read_text())
    assert "1 of 3 steps could not be compared" in page.text
    assert "failed frame: no rod was found" in page.text
    assert "Step 2 (60.0 mm gap)" in page.text  # as the run counts them
    assert "Step 0" not in page.text
    assert 'role="alert"' in single.read_text()


def test_page_holds_what_a_report_owes(single: Path) -> None:
    page = Page(single.read_text())
    for heading in (
        "Photographs", "Shapes", "Distances", "How circular", "Field",
        "Fitted stiffness", "Error budget at the tip", "Provenance",
    ):  # fmt: skip
        assert heading in page.text
    assert "nan" not in re.sub(r"[a-z]nan|nan[a-z]", "", page.text.lower())
    assert page.tags.count("image") == 3
    assert single.read_text().count('class="figure"') == 4


def test_figures_lie_beside_as_pdf_with_fonts(single: Path) -> None:
    pdfs = sorted((single.parent / "figures").glob("*.pdf"))
    assert [pdf.stem for pdf in pdfs] == ["field", "fit", "residuals", "shapes"]
    for pdf in pdfs:
        data = pdf.read_bytes()
        assert data.startswith(b"%PDF")
        assert b"FontFile2" in data  # TrueType, embedded


def test_same_run_gives_the_same_figures(tmp_path: Path) -> None:
    from magbend.analysis.figures.run import shapes_figure
    from magbend.analysis.figures.style import to_pdf, to_svg

    run = compared(tmp_path / "a")
    first, second = shapes_figure(run), shapes_figure(run)
    assert to_svg(first, "x") == to_svg(second, "x")
    assert to_pdf(first) == to_pdf(second)


def test_names_from_files_cannot_break_the_page(tmp_path: Path) -> None:
    from dataclasses import replace

    evil = replace(sim.gmc(2), name="<script>alert(1)</script> & 'x'")
    path = tmp_path / "a"
    run = compared(path, specimen=evil)
    write_report([run], path / "report.html")
    text = (path / "report.html").read_text()
    assert "<script>alert" not in text
    assert "&lt;script&gt;" in text


def test_all_failed_run_still_has_a_report(tmp_path: Path) -> None:
    path = tmp_path / "a"
    run = compared(path, failed=[0, 1, 2], overload=[0, 1, 2], end=False)
    write_report([run], path / "report.html", fits=[try_fit(run.run)])
    page = Page((path / "report.html").read_text())
    assert "3 of 3 steps could not be compared" in page.text
    assert "No fit: no step can be fitted" in page.text
    assert "cut off" in page.text
    assert "No field calibration" in page.text


def test_report_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="at least one run"):
        write_report([], tmp_path / "report.html")


@pytest.mark.parametrize("count", [12, pytest.param(100, marks=pytest.mark.slow)])
def test_many_runs_are_light_and_quick(
    tmp_path: Path, photograph: bytes, count: int
) -> None:
    """Each costs a fifth of a report of one, and 20 MB are for 100 runs."""
    runs = [
        compared(tmp_path / f"run{k:03d}", failed=[1] if k == 5 else [],
                 image=photograph)
        for k in range(count)
    ]  # fmt: skip

    def seconds(number: int) -> float:
        start = time.process_time()
        write_report(
            runs[:number], tmp_path / "report.html", fits=["left out"] * number
        )
        return time.process_time() - start

    seconds(1)  # the first loads what draws
    alone = seconds(1)
    share = (seconds(count) / alone - 1.0) / (count - 1)
    megabytes = (tmp_path / "report.html").stat().st_size / 1e6
    print(f"{count} runs with photographs: {megabytes:.1f} MB, {alone:.1f} s for one")
    assert share < 0.25
    assert megabytes < 0.2 * count
    page = Page((tmp_path / "report.html").read_text())
    assert f"1 of {3 * count} steps could not be compared" in page.text
    assert page.text.count("failed frame") >= 2


def test_budget_is_sorted_and_true(tmp_path: Path) -> None:
    """The gap's share is checked against moving the gap."""
    run = compared(tmp_path / "a")
    lines = tip_budget(run)
    sizes = [line.tip_um for line in lines]
    assert sizes == sorted(sizes, reverse=True)
    gap = next(line for line in lines if line.cause == "gap")
    assert run.magnet is not None
    tips = []
    for gap_mm in (50.0 - ASSUMED["gap_mm"], 50.0 + ASSUMED["gap_mm"]):
        field = sim.MagnetField(magnet=run.magnet, gap_mm=gap_mm)
        line = sim.solve(run.run.specimen, field).centreline
        assert line is not None
        tips.append(np.array(line.tip_mm))
    moved_um = 1e3 * float(np.linalg.norm(tips[1] - tips[0])) / 2.0
    assert gap.tip_um == pytest.approx(moved_um, rel=1e-3)


def test_turning_the_clamp_counts_without_the_frame_that_turns_along(
    tmp_path: Path,
) -> None:
    run = compared(tmp_path / "a")
    assert run.magnet is not None
    field = sim.MagnetField(magnet=run.magnet, gap_mm=50.0)
    tips = []
    for angle_deg in (-ASSUMED["clamp_angle_deg"] / 2, ASSUMED["clamp_angle_deg"] / 2):
        support = sim.Support(clamp_angle_deg=angle_deg)
        line = sim.solve(run.run.specimen, field, support=support).centreline
        assert line is not None
        turn = np.radians(-angle_deg)
        rotation = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        tips.append(np.array(rotation) @ line.tip_mm)
    lines = {line.cause: line for line in tip_budget(run)}
    moved_um = 1e3 * float(np.linalg.norm(tips[1] - tips[0]))
    assert lines["direction of the clamp"].tip_um == pytest.approx(moved_um, rel=1e-3)
    # 0.3 deg of a rod of 30 mm
    assert lines["frame at the clamp"].tip_um == pytest.approx(157.0, rel=0.02)


@pytest.mark.parametrize(
    ("value", "text"),
    [(float("nan"), "–"), (None, "–"), (float("inf"), "∞"), (-0.0001, "0.000")],
)
def test_numbers_are_readable(value: float | None, text: str) -> None:
    assert number(value) == text


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the PATH")
def test_browser_shows_it_without_errors(tmp_path: Path, photograph: bytes) -> None:
    run = compared(tmp_path / "gmc2", specimen=sim.gmc(2), image=photograph)
    out = tmp_path / "report.html"
    write_report([run], out)
    browser(tmp_path, out)


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the PATH")
def test_a_click_on_a_head_sorts_the_table_and_a_second_one_turns_it(
    tmp_path: Path, photograph: bytes
) -> None:
    runs = [
        compared(tmp_path / f"gmc{k}", specimen=sim.gmc(k), image=photograph)
        for k in (2, 4, 5)
    ]
    out = tmp_path / "report.html"
    write_report(runs, out, by_number={2: runs[0]})
    page = out.read_text(encoding="utf-8")
    # What a reader does, done to a copy of the page by a script at its end.
    script = """<script>
        const table = document.querySelector("table.sortable");
        const head = [...table.tHead.rows[0].cells].find(
            (cell) => cell.textContent.includes("RMS"));
        const seen = [1, 2].map((click) => {
            head.click();
            const values = [...table.tBodies[0].rows].map(
                (row) => row.cells[head.cellIndex].textContent.trim());
            return head.ariaSort + ": " + values.join(" ");
        });
        document.title = "sorted " + seen.join(", ");
    </script></body>"""
    copy = tmp_path / "clicked.html"
    copy.write_text(page.replace("</body>", script), encoding="utf-8")
    shown = browser(tmp_path, copy)
    assert "All comparisons" in shown
    found = re.search(r"<title>sorted (\w+): ([^<]*), (\w+): ([^<]*)</title>", shown)
    assert found is not None, shown[:500]
    assert (found[1], found[3]) == ("ascending", "descending")
    rising, falling = ([float(text) for text in found[k].split()] for k in (2, 4))
    assert len(rising) == len(falling) == 18
    assert len(set(rising)) > 9
    assert rising == sorted(rising)
    assert falling == sorted(falling, reverse=True)


def browser(tmp_path: Path, page: Path) -> str:
    """Return what Chromium makes of a page, which has no error and asks for nothing."""
    assert CHROMIUM is not None
    done = subprocess.run(
        [
            CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic",
            "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync", "--enable-logging=stderr",
            "--host-resolver-rules=MAP * ~NOTFOUND",
            f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", page.as_uri(),
        ],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    for trouble in ("CONSOLE", "Uncaught", "ERR_"):
        assert trouble not in done.stderr, done.stderr
    return done.stdout


def test_a_report_says_at_once_that_its_bench_is_simulated(tmp_path: Path) -> None:
    run = compare_run(load_run(write_run(tmp_path / "gmc2")))  # marked as a twin
    page = write_report([run], tmp_path / "r.html").html.read_text()
    head = page[page.index("<header>") : page.index("</header>")]
    assert "a simulated bench (twin), no experiment" in head


def test_tables_of_the_needed_columns_alone_make_a_report(tmp_path: Path) -> None:
    """Pictures and pixels are gone; shapes and numbers stay (reports.md, case 23)."""
    import pandas as pd

    path = write_run(tmp_path / "gmc2")
    for name, columns in (
        ("frames.csv", ["image", "status"]),
        ("centrelines.csv", ["image", "s_mm", "x_mm", "y_mm", "theta_rad"]),
    ):
        pd.read_csv(path / name)[columns].to_csv(path / name, index=False)
    run = compare_run(load_run(path, unverified=True))
    page = write_report([run], tmp_path / "r.html").html.read_text()
    assert "no photograph in the run folder" in page
    assert all(c.ok for c in run.of("magnet"))
