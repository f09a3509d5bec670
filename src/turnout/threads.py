"""One BLAS thread per process: the processes share the cores among themselves."""

import os

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")


def one_thread() -> None:
    """To be called before numpy is imported. Snakemake sets these to the threads of a job, each of whose
    processes would then start as many: four times the CPU time for small matrices."""
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
