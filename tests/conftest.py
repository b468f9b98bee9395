"""What holds for every test: no window, no silent number, no hidden chance."""

from __future__ import annotations

import fcntl
import gc
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest

from diagrams import Scenario, load_scenario

# An environment variable, so that subprocesses draw without a window too.
os.environ["MPLBACKEND"] = "Agg"

# The same examples on every machine; a busy machine is no failure. Examples are
# drawn from the numbers in the code, too: how many of them a test filters out
# must not decide whether an edit elsewhere passes.
hypothesis.settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,
    suppress_health_check=[
        hypothesis.HealthCheck.filter_too_much,
        hypothesis.HealthCheck.too_slow,
    ],
)
hypothesis.settings.load_profile("repeatable")

# Compiling makes objects by the million, most of which stay: looking through them as
# often as Python does takes a tenth of its time.
gc.set_threshold(20_000, 20)


def pytest_collection_finish() -> None:
    """What the tests have loaded stays, and need not be looked through either."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def raise_on_floating_point_errors() -> Iterator[None]:
    """Overflow, division by zero and NaN are errors.

    Underflow is not: a decaying exponential that ends at zero is right.
    """
    with np.errstate(all="raise", under="ignore"):
        yield


@pytest.fixture(autouse=True)
def forbid_global_numpy_generator() -> Iterator[None]:
    """Noise comes from a seed that somebody gave, never from numpy's own."""
    before = np.random.get_state(legacy=False)  # noqa: NPY002  # to see it untouched
    yield
    after = np.random.get_state(legacy=False)  # noqa: NPY002
    np.testing.assert_equal(
        after, before, err_msg="drawn from numpy's global generator; pass a seed"
    )


@pytest.fixture(scope="session")
def made_once(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[str, Callable[[Path], None]], Path]:
    """A folder that one of the test processes fills for all: ``(name, fill)``."""
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent

    def folder_of(name: str, fill: Callable[[Path], None]) -> Path:
        folder, done = root / name, root / f"{name}.done"
        with (root / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                fill(folder)
                done.touch()
        return folder

    return folder_of


@pytest.fixture
def no_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sweeps do their runs in this process: a worker takes 3 s to start.

    ``tests/analysis/batches/test_sweep.py`` and ``tests/test_cli_sweep.py`` have
    workers, and hold that they give the same rows.
    """
    from analysis.batches.one_run import Outcome, Task, run_task

    def here(
        tasks: Iterator[Task], pulse: Callable[[], None], *, workers: int
    ) -> Iterator[Outcome]:
        assert workers >= 1
        for task in tasks:
            yield run_task(task)
            pulse()

    monkeypatch.setattr("analysis.batches.sweep.run_locally", here)


#: Chromium without a window: no call home, and no way out, for every other name is
#: unknown and the proxy is nowhere.
_CHROMIUM_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-logging=stderr",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost",
    "--proxy-server=127.0.0.1:9",
    "--window-size=900,600",
)


def _without_network() -> list[str]:
    """A prefix that takes a program's network away, where that is permitted."""
    prefix = ["unshare", "--map-root-user", "--net"]
    tried = subprocess.run([*prefix, "true"], capture_output=True, check=False)
    return prefix if tried.returncode == 0 else []


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """Opens a page without network: ``chromium(page, option, ...)`` -> its log.

    What a page writes to its console stands in the log after ``CONSOLE``.
    """
    browser = shutil.which("chromium")
    if browser is None:
        pytest.fail("chromium is not on PATH; install the package chromium")
    prefix = _without_network()

    def run(page: Path, *options: str) -> str:
        profile = tmp_path_factory.mktemp("profile")
        done = subprocess.run(
            [
                *prefix,
                browser,
                *_CHROMIUM_FLAGS,
                f"--user-data-dir={profile}",
                *options,
                page.as_uri(),
            ],
            capture_output=True,
            text=True,
            timeout=180.0,
            check=False,
        )
        # Pages of the browser's own complain where the machine is slow.
        lines = done.stderr.splitlines(keepends=True)
        return "".join(line for line in lines if "source: chrome://" not in line)

    return run


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Chromium by Playwright; its pages have no network."""
    from playwright.sync_api import sync_playwright

    executable = shutil.which("chromium")
    if executable is None:
        pytest.fail("chromium is not on PATH; install the package chromium")
    arguments = [flag for flag in _CHROMIUM_FLAGS if "headless" not in flag]
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(
            executable_path=executable, args=[*arguments, "--disable-gpu"]
        )
        yield opened
        opened.close()


#: Widths at which pages must do, in pixels: a telephone, two windows.
WIDTHS = (390, 1100, 1400)
#: Of axe-core: contrast after WCAG 2.2 AA, 4.5 to 1, and what a keyboard needs.
_AXE_RULES = (
    "color-contrast",
    "scrollable-region-focusable",
    "tabindex",
    "button-name",
    "link-name",
    "label",
    "select-name",
    "image-alt",
    "svg-img-alt",
    "html-has-lang",
    "document-title",
)
#: What a page lets one do, as long as it can be seen.
_CONTROLS = """() => [...document.querySelectorAll(
    "a[href], button, select, input, textarea, [tabindex='0']")]
    .filter((e) => e.checkVisibility({visibilityProperty: true}) && !e.disabled)"""


@pytest.fixture(scope="session")
def check_page(browser: Any) -> Callable[..., None]:
    """``check_page(path, ready)``: a page does, at all widths, by day and by night.

    No error on the console, nothing beside the window, contrast and names as axe-core
    wants them, every control reached by the Tab key, and nothing loaded from
    elsewhere. ``ready`` is a selector that is there once the page's script is.
    """
    from axe_playwright_python.sync_playwright import Axe

    axe = Axe()

    def check(path: Path, ready: str = "body") -> None:
        for width, scheme in product(WIDTHS, ("light", "dark")):
            context = browser.new_context(
                viewport={"width": width, "height": 844},
                color_scheme=scheme,
                reduced_motion="reduce",
                offline=True,
            )
            page, where = context.new_page(), f"{width} px, {scheme}"
            wrong: list[str] = []
            page.on("pageerror", lambda error, wrong=wrong: wrong.append(str(error)))
            page.on(
                "console",
                lambda said, wrong=wrong: (
                    wrong.append(said.text) if said.type == "error" else None
                ),
            )
            page.goto(path.as_uri())
            page.wait_for_selector(ready, state="attached")
            wide = page.evaluate("document.documentElement.scrollWidth")
            assert wide <= width, where
            found = axe.run(page, options={"runOnly": [*_AXE_RULES]}).response
            assert not found["violations"], (where, found["violations"])
            if scheme == "light":
                _check_keyboard(page, where)
            assert not wrong, where
            context.close()

    return check


def _check_keyboard(page: Any, where: str) -> None:
    """Tab comes to every control, and each shows that it has been reached.

    None is beside the window then, as in a drawer that is closed.
    """
    controls = page.evaluate(f"({_CONTROLS})().length")
    page.evaluate(f"({_CONTROLS})().forEach((e, k) => e.dataset.control = k)")
    reached: set[str] = set()
    for _ in range(controls + 60):
        page.keyboard.press("Tab")
        control, shown = page.evaluate(
            """() => { const e = document.activeElement, s = getComputedStyle(e);
            const {left, right, top, bottom} = e.getBoundingClientRect();
            const inside = right > 0 && left < innerWidth && bottom > 0 &&
                top < innerHeight;
            return [e.dataset.control ?? "", s.outlineStyle !== "none" && inside]; }"""
        )
        if control:
            assert shown, (where, control)
            reached.add(control)
        if len(reached) == controls:
            return
    pytest.fail(f"{where}: Tab reaches {len(reached)} of {controls} controls")


@pytest.fixture(scope="session")
def two_boxes() -> Callable[..., Scenario]:
    """``two_boxes(law, *overrides)``: a resting source behind two boxes.

    All gains are stated, so that other defaults change nothing here.
    """

    def make(law: str, *overrides: str) -> Scenario:
        gains = (
            f"law={law}",
            "attraction.stiffness_n_m=2.0",
            "attraction.damping_n_s_m=1.0",
            "attraction.follow_distance_m=1.2",
            "laws.conventional.stiffness_n_m=16",
            "laws.conventional.damping_n_s_m=0.8",
            "laws.conventional.reach_m=0.8",
            "laws.active.reference_stiffness_n_m=64",
            "laws.active.matched_stiffness_n_m=16",
            "laws.active.reach_m=0.8",
            "laws.active.reference_damping_n_s_m=0.2",
            "laws.active.matched_damping_n_s_m=0.8",
            "laws.active.speed_limit_m_s=0.6",
            "robot.top_speed_m_s=0.72",
            "laws.conventional2017.distance_gain_j=1.1",
            "laws.active2017.distance_gain_j=1.1",
            "laws.active2017.saturation_distance_m=0.1",
            "laws.active2017.damping_n_s_m=0.8",
        )
        return load_scenario("two_static_obstacles", [*gains, *overrides])

    return make
