"""The tutorial notebooks run in a fresh kernel, and are kept without their outputs."""

import json
import re
import sys
from pathlib import Path

import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))
CELL_S = 120
DRAWS = re.compile(r"\.plot_\w+\([^\n]*\)$|^plt\.show\(\)$", re.MULTILINE)


class ThisPython(AsyncKernelManager):
    """Starts kernels with the Python that runs the tests, whatever kernels are installed."""

    @property
    def kernel_spec(self):
        command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        return KernelSpec(argv=command, display_name="Python 3", language="python")


def code_cells(notebook):
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def path(request):
    return request.param


def test_it_runs_and_draws_what_it_promises(path, tmp_path, monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook,
        timeout=CELL_S,
        kernel_name="python3",
        kernel_manager_class=ThisPython,
        resources={"metadata": {"path": str(tmp_path)}},
    )
    client.execute()  # raises for a cell with an error
    for cell in code_cells(notebook):
        shown = {kind for output in cell["outputs"] for kind in output.get("data", {})}
        drawn = "image/png" in shown
        assert drawn == ("figure" in cell["metadata"].get("tags", [])), cell["source"]
        errors = [o for o in cell["outputs"] if o.get("name") == "stderr"]
        assert not errors, errors
    assert list(tmp_path.iterdir()) == []


def test_it_is_kept_without_outputs(path):
    kept = json.loads(path.read_text(encoding="utf-8"))
    assert (kept["nbformat"], kept["metadata"]["kernelspec"]["name"]) == (4, "python3")
    for cell in code_cells(kept):
        assert cell["outputs"] == []
        assert cell["execution_count"] is None
    nbformat.validate(nbformat.from_dict(kept))


def test_cells_that_draw_say_so(path):
    tagged = []
    for cell in code_cells(json.loads(path.read_text(encoding="utf-8"))):
        promised = "figure" in cell["metadata"].get("tags", [])
        assert promised == bool(DRAWS.search("".join(cell["source"])))
        tagged.append(promised)
    assert any(tagged)


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} == {
        "compare-your-own-controller",
        "reproduce-the-paper",
    }
