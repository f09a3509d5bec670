"""Hash of the content of a file."""

import hashlib
import os


def sha256_of(path: os.PathLike | str) -> str:
    """sha256 of the bytes of a file.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    str
        64 hexadecimal digits.

    Raises
    ------
    OSError
        If it is absent or not readable.

    Examples
    --------
    FIPS 180-4: the sha256 of empty content.

    >>> sha256_of(os.devnull)[:16]
    'e3b0c44298fc1c14'
    """
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
