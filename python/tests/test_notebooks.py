"""Runs the notebooks. Their outputs must equal the stored outputs.

With MURMURATION_WRITE_NOTEBOOKS=1 in the environment, the outputs of this run are stored instead.
"""

import os
import re
import shutil
import warnings
from importlib.util import find_spec
from pathlib import Path

import nbclient
import nbformat
import pytest
from nbformat import NotebookNode
from test_learned import LATENT

FOLDER = Path(__file__).resolve().parents[2] / "examples/notebooks"
SECONDS_FOR_A_CELL = 600
# The tag of cells at the end of a notebook that need PyTorch. On Linux with x86-64, PyPI has it only with
# 3 GB of CUDA, so it is not a dependency of the tests.
NEEDS_PYTORCH = "pytorch"


def execute(notebook: NotebookNode, folder: Path) -> None:
    """Runs all cells, and removes from their outputs the parts that differ from run to run."""
    nbclient.NotebookClient(
        notebook, timeout=SECONDS_FOR_A_CELL, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    ).execute()
    for cell in code_cells(notebook):
        cell.metadata.pop("execution", None)
        cell.outputs = [output for output in cell.outputs if not passing(output)]


def passing(output: NotebookNode) -> bool:
    """Whether an output differs from run to run: a bar with its times, or a warning of a package's version."""
    is_bar = output.output_type == "display_data" and list(output.data) == ["text/plain"]
    return is_bar or output.get("name") == "stderr"


def code_cells(notebook: NotebookNode) -> list[NotebookNode]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def without_pytorch(notebook: NotebookNode) -> None:
    """Leaves out the cells that need PyTorch."""
    notebook.cells = [cell for cell in notebook.cells if NEEDS_PYTORCH not in cell.metadata.get("tags", [])]


def words(cell: NotebookNode) -> list[str]:
    """The words and numbers of a cell's outputs. Pictures and lines of tables differ between versions of packages."""
    texts = [output.get("text") or output.get("data", {}).get("text/plain", "") for output in cell.outputs]
    return [word for text in texts for word in re.findall(r"[\w.-]+", text)]


def test_a_saved_notebook_has_finished_bars_as_text(tmp_path: Path) -> None:
    first, last = "import murmuration as mm", "client.close()"
    run = f"client = mm.local(workers=1, trainers=1)\ncampaign = client.run({LATENT})"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in (first, run, last)])
    nbclient.NotebookClient(notebook, timeout=SECONDS_FOR_A_CELL, resources={"metadata": {"path": tmp_path}}).execute()
    outputs = notebook.cells[1].outputs
    assert [list(output.data) for output in outputs] == [["text/plain"]] * len(outputs)
    bars = [output.data["text/plain"] for output in outputs]
    assert {bar.partition(":")[0] for bar in bars} >= {"dataset", "evolve"}
    for bar in bars:
        assert ("100%|" in bar or bar.endswith(": done")) and "\r" not in bar, bars


@pytest.mark.parametrize("notebook", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs_and_says_what_it_said(notebook: Path, tmp_path: Path) -> None:
    kept = nbformat.read(notebook, as_version=4)
    run = nbformat.read(notebook, as_version=4)
    everything = len(run.cells)
    if find_spec("torch") is None:
        without_pytorch(kept)
        without_pytorch(run)
    if len(run.cells) < everything:
        warnings.warn(f"there is no PyTorch: {everything - len(run.cells)} cells of it are not run", stacklevel=1)
    for table in FOLDER.glob("*.csv"):
        shutil.copy(table, tmp_path)
    execute(run, tmp_path)
    if os.environ.get("MURMURATION_WRITE_NOTEBOOKS"):
        assert len(run.cells) == everything, "outputs are kept of all cells: install PyTorch"
        nbformat.write(run, notebook)
        return
    cells = code_cells(run)
    assert len(cells) >= 5
    for kept_cell, cell in zip(code_cells(kept), cells, strict=True):
        assert words(cell) == words(kept_cell), cell.source
        assert cell.execution_count == kept_cell.execution_count
