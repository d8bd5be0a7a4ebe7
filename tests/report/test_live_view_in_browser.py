"""The live view in Chromium: it follows the files, and says so when it cannot."""

import threading
from pathlib import Path
from typing import Any

import made_up
from watched_pages import NEEDS_CHROMIUM, Watched, pixels

from vdsm_pin.app.visualization import ViewServer
from vdsm_pin.io.trajectory_file import write_trajectory

pytestmark = NEEDS_CHROMIUM


def test_a_live_page_follows_a_file_and_keeps_the_moment_and_the_camera(
    browser: Any, tmp_path: Path
) -> None:
    motion = tmp_path / "t.csv"
    write_trajectory(made_up.trajectory(40), motion)
    server = ViewServer("paper/obs1", motion, 0, watch=True)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    watched = Watched(browser, server.url, viewport={"width": 800, "height": 600})
    page = watched.page
    try:
        page.wait_for_function("window.vdsm && vdsm.motion.end === 39")
        page.evaluate("vdsm.motion.go(12.5); vdsm.view.look('top')")
        assert len(set(map(tuple, pixels(page)))) > 100, "something is drawn"
        eye = page.evaluate("vdsm.view.eye()")
        write_trajectory(made_up.trajectory(30), motion)
        page.wait_for_function("window.vdsm && vdsm.motion.end === 29")
        page.wait_for_function("vdsm.motion.time === 12.5")
        assert page.evaluate("vdsm.view.eye()") == eye
        motion.write_text("waypoint,oops\n")
        page.wait_for_selector(".banner.error")
        assert "t.csv" in page.inner_text(".banner")
        write_trajectory(made_up.trajectory(20), motion)
        page.wait_for_function("window.vdsm && vdsm.motion.end === 19")
        assert page.locator("[data-lost]").is_hidden()
        watched.shot("view-live")
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    page.locator("[data-lost]").wait_for(state="visible")
    assert watched.errors == []
    assert all(request.startswith(server.url) for request in watched.requests)
