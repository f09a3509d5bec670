"""One BLAS thread per process: the processes share the cores, and results do not depend on the number of cores."""

import os

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")


def use_one_thread() -> None:
    """Limit BLAS to one thread; call this before numpy is imported.

    Snakemake sets these variables to the number of threads of a job, and each process of the job would start as many.
    That costs four times the CPU time for small matrices.
    """
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
