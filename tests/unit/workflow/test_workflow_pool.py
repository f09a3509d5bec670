"""Processes that are forked for tasks."""

import subprocess
import sys

PROGRAM = """
import gc, os, sys
from turnout.workflow.pool import map_in_processes

class Connection:
    def __init__(self):
        self.self = self  # only the garbage collector finds it

    def __del__(self):
        print("destroyed in", "the parent" if os.getpid() == parent else "another process", flush=True)

def task(_):
    gc.collect()
    return os.getpid()

gc.disable()  # nothing is collected before the processes are forked
parent = os.getpid()
Connection()
assert parent not in set(map_in_processes(task, range(4), 2))
gc.collect()
"""


def test_a_forked_process_destroys_no_object_that_it_inherited():
    """DuckDB 2.0.1 ends a forked process with a segmentation fault when a connection of its parent is collected there.

    In a program of its own: the tests keep inherited objects in all processes.
    """
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout == "destroyed in the parent\n"
