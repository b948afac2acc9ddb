"""A report in a real browser: it draws, plays, obeys, and asks the network for nothing."""

import os
import re
import shutil

import pytest
from runs import only, result, with_imus, with_winch

from cablesim.report import write_report

pytestmark = pytest.mark.browser

NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "chrome")


def _start(playwright):
    """A browser: the one that CABLESIM_BROWSER names, one on the path, or playwright's own."""
    named = os.environ.get("CABLESIM_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)
    root = hasattr(os, "geteuid") and os.geteuid() == 0  # its sandbox refuses to run as root
    options = {"args": ["--no-sandbox"] if root else []}
    return playwright.chromium.launch(executable_path=named, **options)


@pytest.fixture(scope="module")
def browser():
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with api.sync_playwright() as playwright:
        try:
            started = _start(playwright)
        except api.Error as error:
            pytest.skip(f"no browser starts: {str(error).splitlines()[0]}")
        yield started
        started.close()


@pytest.fixture
def buoys():
    return with_imus(result("buoys"), imu_1=4.0, imu_2=6.0)


class Shown:
    """A report in a page, and what went wrong on it."""

    def __init__(self, browser, dataset, folder, **options):
        file = folder / "run.html"
        write_report(dataset, file)
        self.page = browser.new_page(**({"viewport": {"width": 1280, "height": 800}} | options))
        self.errors, self.requests = [], []
        self.page.on("console", lambda message: self.errors.append(message.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.as_uri())
        self.page.locator("#clock:not(:empty)").wait_for()
        assert self.requests == [file.as_uri()]

    def canvas(self):
        return self.page.evaluate("document.getElementById('scene').toDataURL()")

    def colours(self):
        """How many colours the canvas holds."""
        return self.page.evaluate(
            "(() => { const c = document.getElementById('scene');"
            "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
            "return new Set(new Uint32Array(d.buffer)).size; })()"
        )

    def clock(self):
        return float(self.page.inner_text("#clock").removesuffix(" s"))

    def reading(self, label):
        return self.page.locator("li", has_text=label).first.locator("output").inner_text()


@pytest.fixture
def show(browser, tmp_path):
    shown = []

    def _show(dataset, **options):
        shown.append(Shown(browser, dataset, tmp_path, **options))
        return shown[-1]

    yield _show
    for report in shown:
        assert report.errors == []
        assert len(report.requests) == 1
        report.page.close()


def test_it_draws_and_plays(show, buoys):
    report = show(buoys)
    before = report.canvas()
    assert report.colours() > 50
    assert report.clock() == 0.0
    report.page.keyboard.press("Space")
    report.page.wait_for_timeout(1000)
    report.page.keyboard.press("Space")
    assert 0.5 <= report.clock() <= 1.6
    assert report.canvas() != before
    stopped = report.clock()
    report.page.wait_for_timeout(300)
    assert report.clock() == stopped


def test_it_stops_at_the_end_and_starts_anew(show, buoys):
    report = show(buoys)
    report.page.select_option("#speed", "100")
    report.page.click("#play")
    report.page.locator("#play[data-playing=false]").wait_for()
    assert report.clock() == pytest.approx(float(buoys["time"][-1]))
    report.page.select_option("#speed", "0.1")
    report.page.click("#play")
    assert report.clock() < 1.0
    assert report.page.get_attribute("#play", "aria-label") == "Pause"
    report.page.click("#play")


def test_readings_are_those_of_the_result(show, buoys):
    report = show(buoys)
    for _ in range(7):
        report.page.keyboard.press("ArrowRight")
    report.page.keyboard.press("ArrowLeft")
    assert report.clock() == pytest.approx(float(buoys["time"][6]))
    for number, end in enumerate("AB"):
        read = float(report.reading(f"end {end}").replace("\u2212", "-"))
        assert read == pytest.approx(float(buoys["end_tension"][6, number]), rel=1e-3)


def test_slider_and_plots_choose_the_time(show, buoys):
    report = show(buoys)
    report.page.fill("#slider", "20")
    assert report.clock() == pytest.approx(float(buoys["time"][20]))
    assert report.page.get_attribute("#slider", "aria-valuetext") == f"{report.clock():.1f} s"
    box = report.page.locator("#series svg").first.bounding_box()
    report.page.mouse.click(box["x"] + 0.99 * box["width"], box["y"] + box["height"] / 2)
    assert report.clock() == pytest.approx(float(buoys["time"][-1]))


def test_the_scene_turns_moves_and_zooms(show, buoys):
    report = show(buoys)
    seen = {report.canvas()}

    def drag():
        report.page.mouse.move(400, 400)
        report.page.mouse.down()
        report.page.mouse.move(480, 430, steps=3)
        report.page.mouse.up()

    def drag_with_shift():
        report.page.keyboard.down("Shift")
        drag()
        report.page.keyboard.up("Shift")

    for number, act in enumerate(
        (
            drag,
            drag_with_shift,
            lambda: report.page.mouse.wheel(0, -200),
            lambda: report.page.keyboard.press("Shift+ArrowLeft"),
            lambda: report.page.click("#closer"),
            lambda: report.page.click("[data-view=top]"),
            lambda: report.page.click("[data-view=side]"),
            lambda: report.page.uncheck("[data-option=frames]"),
            lambda: report.page.uncheck("[data-option=names]"),
            lambda: report.page.check("[data-option=follow]"),
            lambda: report.page.fill("#slider", "30"),
            lambda: report.page.check("[data-option=ghosts]"),
        )
    ):
        act()
        report.page.wait_for_timeout(60)
        seen.add(report.canvas())
        assert len(seen) == number + 2, number


def test_a_cable_on_a_drum(show, buoys):
    report = show(with_winch(buoys))
    before = report.canvas()
    report.page.fill("#slider", "30")
    assert report.canvas() != before
    assert report.reading("deployed length") != "\u2013"


def test_a_single_state_is_drawn_and_cannot_be_played(show, buoys):
    report = show(buoys.isel(time=[0]))
    assert report.colours() > 50
    assert report.page.is_disabled("#play")
    report.page.keyboard.press("Space")
    assert "nothing changes with time" in report.page.inner_text("#series")


def test_missing_variables_are_named_on_the_page(show, buoys):
    report = show(only(buoys, "position"))
    assert report.colours() > 30
    assert "no `end_tension`: add it to output.variables" in report.page.inner_text("#series")


def test_a_hostile_title_does_nothing(show, buoys):
    buoys.attrs["title"] = "</script><script>console.log('hello')</script>"
    report = show(buoys)
    assert report.page.title() == buoys.attrs["title"]


@pytest.mark.parametrize("width", [360, 768, 1280, 1920])
def test_nothing_leaves_the_page_at_any_width(show, buoys, width):
    report = show(buoys, viewport={"width": width, "height": 800})
    assert report.page.evaluate("document.documentElement.scrollWidth") <= width
    canvas = report.page.locator("#scene").bounding_box()
    assert canvas["width"] > 0.4 * width
    assert canvas["height"] >= 300


def test_light_and_dark_differ(show, buoys):
    colours = {
        show(buoys, color_scheme=scheme).page.evaluate("getComputedStyle(document.body).backgroundColor")
        for scheme in ("light", "dark")
    }
    assert len(colours) == 2


def test_every_control_has_a_name(show, buoys):
    report = show(buoys)
    tree = report.page.locator("body").aria_snapshot()
    assert not re.findall(r"- (?:button|slider|checkbox|combobox|img)(?::|$| \[)", tree, re.MULTILINE)


@pytest.mark.parametrize("width", [390, 1280])
def test_every_axis_has_a_name(show, buoys, width):
    report = show(buoys, viewport={"width": width, "height": 844})
    names = report.page.locator(".plot .name").all_text_contents()
    assert names == ["time [s]", "time [s]", "s, from A to B [m]", "time [s]"]
    assert report.page.locator(".plot svg").count() == len(names)
    for plot in report.page.locator(".plot svg").all():
        name, paper = plot.locator(".name").bounding_box(), plot.bounding_box()
        assert name["y"] + name["height"] <= paper["y"] + paper["height"] + 1
        for number in plot.locator(".number").all():
            other = number.bounding_box()
            assert other["y"] + other["height"] <= name["y"] + 3
