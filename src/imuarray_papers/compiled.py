"""`njit`: numba's compiler, with a cache that every kernel's source is part of.

numba's own cache asks only whether the file of the function called has changed. A kernel into which
one of another file was compiled would keep the old one after an update, and results would not be
those of the code that they name.
"""

import hashlib
from functools import cache, partial
from pathlib import Path

from imuarray.caches import cache_folder
from imuarray.errors import InputError

try:
    import numba
    from llvmlite import ir
    from numba.extending import intrinsic
except ModuleNotFoundError as error:
    raise InputError(
        f"the papers' kernels: expected {error.name} (pip install 'imuarray[papers]'), found none"
    ) from None

PACKAGE = Path(__file__).parent


def njit(function=None, **options):
    """`numba.njit` with ``nogil`` and the cache, as a decorator with or without ``options``."""
    if function is None:
        return partial(njit, **options)
    folder, before = _folder(), numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder or "")
    try:
        return numba.njit(function, cache=folder is not None, nogil=True, **options)
    finally:
        numba.config.CACHE_DIR = before


# Below, as in no other place, pure Python (NUMBA_DISABLE_JIT) cannot follow.
@intrinsic
def fma(typing, a, b, c):
    """a b + c, rounded once where the processor has an instruction for it, else twice.

    x86 processors have it since 2013, ARM's always: unlike ``fastmath`` it gives the same bits
    however compiled.
    """
    number = numba.types.float64

    def build(_, builder, __, values):
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [double] * 3)
        named = builder.module.declare_intrinsic("llvm.fmuladd", [double], kind)
        return builder.call(named, values)

    return number(number, number, number), build


@intrinsic
def as_number(typing, bits):
    """The number of 64 bits that an unsigned integer's bits are; other types do not compile."""
    if bits != numba.types.uint64:
        return None
    found = numba.types.float64(bits)
    return found, lambda _, builder, __, values: builder.bitcast(values[0], ir.DoubleType())


@intrinsic
def as_bits(typing, number):
    """The bits of a number, as an unsigned integer; other types do not compile."""
    if number != numba.types.float64:
        return None
    found = numba.types.uint64(number)
    return found, lambda _, builder, __, values: builder.bitcast(values[0], ir.IntType(64))


def kernels_digest() -> str:
    """SHA-256, in hexadecimal, of the files that have kernels."""
    files = sorted(PACKAGE.parent.glob(f"{PACKAGE.name}*/**/*.py"))
    texts = ((path, path.read_bytes()) for path in files)
    found = hashlib.sha256()
    for path, text in texts:
        if b"njit" in text:
            found.update(
                path.relative_to(PACKAGE.parent).as_posix().encode() + b"\0" + text + b"\0"
            )
    return found.hexdigest()


@cache
def _folder() -> Path | None:
    """Where these kernels are cached; None where nothing can be written."""
    return cache_folder(f"kernels-{kernels_digest()[:16]}", numba.config.CACHE_DIR)
