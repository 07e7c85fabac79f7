"""A real headless Chromium for the tests of pages."""

import os
import shutil
from contextlib import contextmanager

import pytest
from playwright.sync_api import sync_playwright

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)

in_browser = pytest.mark.skipif(
    CHROMIUM is None and os.environ.get("CI") != "true",
    reason="needs chromium (apt-get install chromium)",
)


@contextmanager
def chromium():
    """The browser; there must be one."""
    assert CHROMIUM is not None, "there is no chromium; apt-get install chromium"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@contextmanager
def opened(browser, address, width=1100, **options):
    """The page, once its runs are shown; asks nobody else and complains of nothing."""
    context = browser.new_context(viewport={"width": width, "height": 900}, **options)
    page = context.new_page()
    requests, complaints = [], []
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(address)
    page.evaluate("coramp.ready")
    yield page
    own = [address] if address.startswith("file:") else None
    assert own is None or requests == own
    origin = address.split("?")[0]
    assert [url for url in requests if not url.startswith(origin)] == []
    assert complaints == []
    context.close()
