"""A page replaces a page of coramp's, and no other file."""

import pytest

from tests.edges import invoke


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "r"
    told = invoke("run", "paper", "--engine", "exact", "--horizon", "20", "--out", folder)
    assert told.code == 0
    return folder


@pytest.mark.parametrize("command", ["report", "replay"])
def test_a_page_of_ours_is_written_anew_and_another_file_stays(folder, command):
    page = folder / f"{command}.html"
    assert invoke(command, folder).code == 0
    first = page.read_bytes()
    assert invoke(command, folder).code == 0
    assert page.read_bytes() == first
    page.write_text("<html><p>notes of mine</html>")
    told = invoke(command, folder)
    assert told.code == 1
    assert told.errors == [
        f"Error: {page}: was not written by coramp; move it, or give it another name"
    ]
    assert page.read_text() == "<html><p>notes of mine</html>"
    page.unlink()
