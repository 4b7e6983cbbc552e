"""A look at another program's NetCDF file in a process of its own.

Wrong bytes can make HDF5 loop for ever or end the process; our own files have a seal for that.
"""

import subprocess
import sys
from pathlib import Path

from imuarray.errors import InputError
from imuarray.provenance import seal_of

SIGNATURE = b"\x89HDF"
PATIENCE = 60.0  # s, and as many again for each
SIZE = 500e6  # bytes
LOOK = """
import sys, h5py
def look(name, item):
    # what declares more than it holds is refused before it is read
    if isinstance(item, h5py.Dataset) and item.nbytes < 1e9:
        item[()]
    dict(item.attrs)
with h5py.File(sys.argv[1], "r") as file:
    dict(file.attrs)
    file.visititems(look)
"""


def require_readable(path: Path, patience: float = PATIENCE) -> None:
    """InputError for an HDF5 file without a seal at which HDF5 hangs or dies.

    ``patience`` in s. What HDF5 refuses by itself, and what is no HDF5 file, is left to the reader.
    """
    with open(path, "rb") as handle:
        if handle.read(len(SIGNATURE)) != SIGNATURE or seal_of(path) is not None:
            return
    limit = patience * (1 + path.stat().st_size / SIZE)
    call = [sys.executable, "-c", LOOK, str(path)]
    try:
        status = subprocess.run(call, capture_output=True, timeout=limit, check=False).returncode
    except subprocess.TimeoutExpired:
        raise InputError(
            f"{path}: expected a NetCDF-4 file, found one that HDF5 is not through with after"
            f" {limit:.0f} s: damaged?"
        ) from None
    if status < 0:
        raise InputError(f"{path}: expected a NetCDF-4 file, found one that HDF5 crashes at")
