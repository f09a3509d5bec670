"""No kernel of the simulation reads or writes beyond an array: compiled code would not notice it."""

import subprocess
import sys

SCRIPT = """
import numpy as np
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.track import uniform_track
from turnout.simulate.vehicle import lone_wheels

prepared = prepare(uniform_track(12.0), 2e-4)
force = lambda t: 1e4 * np.sin(np.pi * np.clip(t / 1e-3, 0.0, 1.0))
impact = run(prepared, 0.004, [Probe(6.3)], pulses=[(6.0, force)])
assert np.max(np.abs(impact.signals)) > 0.0
train = run(prepared, 0.004, [Probe(6.3)], lone_wheels(1000.0, (0.0, 2.5)), Drive(start=6.0, speed=20.0))
assert np.max(np.abs(train.force)) > 0.0
"""


def test_the_simulation_of_impacts_and_wheels_stays_within_its_arrays(repository):
    """Kernels run as Python code, in which an index beyond an array is an error."""
    environment = {"NUMBA_DISABLE_JIT": "1", "PATH": "", "PYTHONPATH": f"{repository / 'src'}"}
    finished = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True)
    assert finished.returncode == 0, finished.stderr[-2000:]
