"""One Chromium for all tests of pages."""

from collections.abc import Iterator
from typing import Any

import pytest
from watched_pages import CHROMIUM, OPENED, SOFTWARE_GL


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=CHROMIUM, args=SOFTWARE_GL
        )
        yield chromium
        chromium.close()


def pages_end() -> Iterator[None]:
    before = len(OPENED)
    yield
    while len(OPENED) > before:
        OPENED.pop().close()


pages_of_a_test_end = pytest.fixture(pages_end, autouse=True)
pages_of_a_module_end = pytest.fixture(pages_end, autouse=True, scope="module")
