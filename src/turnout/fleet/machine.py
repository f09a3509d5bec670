"""Faults of the machine are nobody's result: those of one file pass or are repaired, the others end the job."""

import errno

ONE_FILE = {errno.EIO, errno.ESTALE, errno.EREMOTEIO, errno.ETIMEDOUT, errno.ENOMEM, errno.EACCES}
EVERY_FILE = {errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE}


def of_the_machine(error: BaseException) -> bool:
    """Whether ``error`` says nothing of the unit that met it."""
    return passing(error) or (isinstance(error, OSError) and error.errno in EVERY_FILE)


def passing(error: BaseException) -> bool:
    """Whether the unit that met ``error`` is left for the next run while the others go on.

    A bad sector, a server that does not answer, a file that may not be read or is too large for the memory of this
    moment.

    >>> passing(OSError(errno.EIO, "Input/output error")), passing(OSError(errno.ENOSPC, "No space left on device"))
    (True, False)
    """
    return isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno in ONE_FILE)
