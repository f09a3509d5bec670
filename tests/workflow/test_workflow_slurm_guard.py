"""Background processes of a test end with it, also if the test is killed."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import private_slurm


def test_daemons_end_if_their_test_is_killed(tmp_path):
    daemon = subprocess.Popen(["sleep", "600"], start_new_session=True)
    (tmp_path / "daemon.pid").write_text(f"{daemon.pid}\n")
    code = (
        "import os, signal, sys; from pathlib import Path; import private_slurm\n"
        "private_slurm.start_guard(Path(sys.argv[1]), patience=0.1)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(private_slurm.__file__).parent)}
    test = subprocess.run([sys.executable, "-c", code, str(tmp_path)], env=environment, check=False)
    assert test.returncode == -signal.SIGKILL
    assert daemon.wait(60) == -signal.SIGTERM
