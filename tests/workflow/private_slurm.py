"""A private Slurm on this machine without system services: a test starts it, and it is always stopped."""

import getpass
import os
import secrets
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

NEEDED = ("slurmctld", "slurmd", "munged", "sbatch", "squeue", "srun", "scancel", "scontrol")
SBIN = "/usr/sbin:/usr/local/sbin:/sbin"
CONF = """\
ClusterName=turnout
SlurmctldHost=localhost
SlurmUser={user}
{slurmd_user}
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={base}/run/munge.socket
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
ReturnToService=2
StateSaveLocation={base}/state
SlurmdSpoolDir={base}/spool
SlurmctldPidFile={base}/run/slurmctld.pid
SlurmdPidFile={base}/run/slurmd.pid
SlurmctldLogFile={base}/log/slurmctld.log
SlurmdLogFile={base}/log/slurmd.log
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=2,batch_sched_delay=0
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
MinJobAge=300
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
NodeName=localhost NodeAddr=127.0.0.1 CPUs=4 RealMemory=8000 State=UNKNOWN
PartitionName=batch Nodes=localhost Default=YES MaxTime=INFINITE State=UP
"""


def missing():
    """Required programs that are not installed."""
    path = f"{os.environ.get('PATH', '')}:{SBIN}"
    return [name for name in NEEDED if shutil.which(name, path=path) is None]


class Slurm:
    """``with Slurm(folder) as slurm``: programs of Slurm need the variables in ``slurm.environment``."""

    def __init__(self, folder):
        self.base = Path(folder)
        self.path = f"{os.environ.get('PATH', '')}:{SBIN}"
        conf = str(self.base / "slurm.conf")
        self.environment = os.environ | {"SLURM_CONF": conf, "PATH": f"{self.base}/bin:{self.path}"}

    def __enter__(self):
        for name in ("run", "log", "state", "spool", "bin"):
            (self.base / name).mkdir(parents=True)
        os.chmod(self.base, 0o755)
        os.chmod(self.base / "run", 0o755)
        user = getpass.getuser()
        ports = free_ports(2)
        slurmd_user = "" if user == "root" else f"SlurmdUser={user}"
        text = CONF.format(base=self.base, user=user, slurmd_user=slurmd_user, ports=ports)
        (self.base / "slurm.conf").write_text(text)
        key = self.base / "munge.key"
        key.write_bytes(secrets.token_bytes(128))
        key.chmod(0o600)
        # The inner job step of the executor clears SLURM_CONF before it calls srun: this script sets it again.
        shim = self.base / "bin/srun"
        real = shutil.which("srun", path=self.path)
        shim.write_text(f'#!/bin/sh\nSLURM_CONF={self.base}/slurm.conf exec {real} "$@"\n')
        shim.chmod(0o755)
        self.guard = start_guard(self.base / "run", self.environment)
        try:
            self._start(user)
        except BaseException:
            self.__exit__()
            raise
        return self

    def _start(self, user):
        run = self.base / "run"
        munged = [
            "munged", f"--key-file={self.base}/munge.key", f"--socket={run}/munge.socket",
            f"--pid-file={run}/munged.pid", f"--log-file={self.base}/log/munged.log", f"--seed-file={run}/munge.seed",
        ]  # fmt: skip
        self.call(*munged, *(["--force"] if user == "root" else []))
        self.call("slurmctld", "-c")
        self.call("slurmd", "-N", "localhost")
        end = time.monotonic() + 60
        while "idle" not in self.call("sinfo", "-h", "-o", "%T", check=False):
            if time.monotonic() > end:
                logs = "\n".join(p.read_text()[-2000:] for p in (self.base / "log").glob("*.log"))
                raise TimeoutError(f"Slurm is not idle after 60 s\n{logs}")
            time.sleep(0.5)

    def call(self, *command, check=True):
        """Output of a program."""
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60)
        if check and done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.stdout}{done.stderr}")
        return done.stdout

    def __exit__(self, *_):
        try:
            self.call("scancel", "--me", check=False)
            self.call("scontrol", "shutdown", check=False)
        except subprocess.TimeoutExpired:
            pass
        finally:
            self.guard.stdin.close()
            self.guard.wait(30)


# The guard reads until its parent process closes the pipe or dies, also by SIGKILL, and then stops the daemons.
GUARD = """
import os, pathlib, shutil, subprocess, sys, time
sys.stdin.read()
if shutil.which("scancel"):
    try:
        subprocess.run(["scancel", "--me"], timeout=10, capture_output=True)
    except subprocess.TimeoutExpired:
        pass
time.sleep(float(sys.argv[2]))
for number in (15, 9):
    for path in sorted(pathlib.Path(sys.argv[1]).glob("*.pid")):
        try:
            os.kill(int(path.read_text()), number)
        except (OSError, ValueError):
            pass
    time.sleep(float(sys.argv[2]))
"""


def start_guard(run, environment=None, patience=1.0):
    """Process that stops the daemons with numbers in ``run``/*.pid when this process closes it or dies."""
    command = [sys.executable, "-c", GUARD, str(run), str(patience)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True, env=environment)


def free_ports(n):
    """Ports on which no program listens."""
    sockets = [socket.socket() for _ in range(n)]
    try:
        for s in sockets:
            s.bind(("127.0.0.1", 0))
        return [s.getsockname()[1] for s in sockets]
    finally:
        for s in sockets:
            s.close()
