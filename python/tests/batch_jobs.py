"""Functions that batches of the tests run in other processes. Each leaves a line in a log when it begins
and when it ends."""

from __future__ import annotations

import os
import signal
import time

import numpy as np


def log(path, text):
    """One write to a file opened for appending: lines of several processes do not mix."""
    file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    os.write(file, (text + "\n").encode())
    os.close(file)


def work(item):
    a = item.arguments
    log(a["log"], f"begin {item.id} {os.getpid()}")
    act = a.get("act")
    if act == "abort":
        os.abort()
    if act == "abort once" and not os.path.exists(a["mark"]):
        open(a["mark"], "w").close()
        os.abort()
    if act == "segv":
        os.kill(os.getpid(), signal.SIGSEGV)
    if act == "exit":
        print("had enough")
        os._exit(3)
    if act == "raise":
        raise KeyError("mine")
    if act == "nothing":
        return None
    if act == "memory":
        return {"much": np.ones(1 << 29)}
    time.sleep(a.get("sleep", 0.0))
    # On a node that is to be lost, when six items have ended: in the middle for as long as it takes.
    if a.get("victim") == os.environ.get("RAY_RAYLET_PID", "") and open(a["log"]).read().count("end ") >= 6:
        log(a["log"], f"middle {item.id} {os.getpid()}")
        time.sleep(300)
    log(a["log"], f"end {item.id} {os.getpid()}")
    return {"square": np.arange(3) ** 2 * int(item.id[1:]), "name": item.id, "bad": float("nan")}
