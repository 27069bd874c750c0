"""Work that kills its worker; in a module of its own, since workers import the whole of it."""

import os
import signal

from cuecast.dubbing.catalogue import Task


def deadly(task: Task) -> dict[str, str]:
    if task.output.endswith("deadly"):
        os.kill(os.getpid(), signal.SIGKILL)
    return {"status": "done"}
