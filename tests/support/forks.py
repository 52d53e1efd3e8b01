"""Code in processes of their own that start quickly: forks of one that has imported some modules.

A new interpreter spends seconds on its imports; a fork of one takes milliseconds, and is as good
where it does not matter who imported those modules.
"""

from __future__ import annotations

import atexit
import functools
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

PARENT = """
import importlib, json, os, sys, traceback

def run(task):
    os.chdir(task["folder"])
    os.environ.clear()
    os.environ.update(task["environment"])
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(os.open(os.path.join(task["output"], name), os.O_WRONLY | os.O_CREAT), number)
    sys.path.insert(0, task["folder"])
    main = sys.modules["__main__"] = type(sys)("__main__")
    name = task["file"] or "<string>"
    if task["file"]:
        main.__file__ = task["file"]
    exec(compile(task["code"], name, "exec"), vars(main))

for name in sys.argv[1:]:
    importlib.import_module(name)
print("ready", flush=True)
for line in sys.stdin:
    child = os.fork()
    if child == 0:
        status = 1
        try:
            run(json.loads(line))
            status = 0
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


class Forks:
    """A process that has imported modules; :meth:`run` runs code in a fork of it.

    Args:
        modules: What it has imported.
        options: Options of its interpreter, such as ``-W error``.
    """

    def __init__(self, modules: tuple[str, ...], options: tuple[str, ...] = ()) -> None:
        self._parent = subprocess.Popen(
            [sys.executable, *options, "-c", PARENT, *modules], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._answer() == "ready"
        atexit.register(self._end)

    def run(
        self, code: str, folder: Path, environment: Mapping[str, str] = os.environ, file: str | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run code in a new process.

        Args:
            code: What it runs, as ``python -c`` would.
            folder: Its working directory, the first from which it imports.
            environment: All its variables.
            file: The name by which errors call the code.
        """
        assert self._parent.stdin is not None
        with tempfile.TemporaryDirectory() as output:
            task = {
                "code": code,
                "folder": str(folder),
                "environment": dict(environment),
                "output": output,
                "file": file,
            }
            self._parent.stdin.write(json.dumps(task) + "\n")
            self._parent.stdin.flush()
            status = int(self._answer())
            printed, errors = ((Path(output) / name).read_text(encoding="utf-8") for name in ("stdout", "stderr"))
        return subprocess.CompletedProcess([code], status, printed, errors)

    def _answer(self) -> str:
        assert self._parent.stdout is not None
        return self._parent.stdout.readline().strip()

    def _end(self) -> None:
        self._parent.communicate()


@functools.cache
def forks_of(*modules: str, options: tuple[str, ...] = ()) -> Forks:
    """Return the process that has imported these modules; one for all tests of a process."""
    return Forks(modules, options)
