"""Runs docs/tutorials/notebook.ipynb from top to bottom and keeps what its cells put out.

    python docs/drawing/notebook.py [--out FILE]

With POSSE_NOTEBOOK_STEPS and POSSE_NOTEBOOK_EPISODES it trains and compares for less.
"""

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import nbformat
import tyro
from nbclient import NotebookClient

NOTEBOOK: Final = Path(__file__).parents[1] / "tutorials" / "notebook.ipynb"
_CONNECTION: Final = re.compile(r"/[\w/]*/tmp\w+\.json")  # the kernel's, in a policy's card
_CONTROL: Final = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|[^\n]*\r(?!\n)")


@dataclass(frozen=True)
class _Arguments:
    out: Path = NOTEBOOK


def run(notebook: Any) -> None:
    """Execute a notebook in a folder of its own; what failed is raised."""
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(notebook, timeout=1800, resources={"metadata": {"path": folder}}, record_timing=False)
        client.execute()
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            if output.output_type == "stream":  # a progress bar leaves only its last state
                output.text = _CONTROL.sub("", output.text)
            if "text/html" in output.get("data", {}):
                page = output.data["text/html"]
                output.data["text/html"] = _CONNECTION.sub("kernel.json", page)
        if "outputs" in cell:
            cell.outputs = [o for o in cell.outputs if o.get("name") != "stderr"]


def main() -> None:
    """Run the notebook."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]
    run(notebook)
    nbformat.write(notebook, tyro.cli(_Arguments).out)  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main()
