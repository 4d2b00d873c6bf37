"""Has the C source of a mechanism compiled, keeps the result on disk, and calls it."""

from __future__ import annotations

import ctypes
import hashlib
import platform
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from irsbot_kinematics.batch import Evaluations
from irsbot_kinematics.cache import cache_folder
from irsbot_kinematics.errors import NotCompiled
from irsbot_kinematics.machine_code.compiler import compile_library, compiler
from irsbot_kinematics.machine_code.source import ARRAYS, c_source
from irsbot_kinematics.machine_code.symbols import NoClosedForm
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.numerics.arithmetic import Array

OPTIONS = ("-O3", "-std=gnu11", "-shared", "-fPIC", "-fopenmp-simd", "-ffp-contract=off")
"""No product is fused with a sum: results differ from those of numpy in the elementary functions alone."""

VECTORS = ("-fno-math-errno", "-fno-trapping-math", "-fno-builtin-sin", "-fno-builtin-cos")
"""Nobody reads errno or the flags of floating point. Sine and cosine as one function have no vector form."""


PART = 65536
"""Samples of one call: a thread has enough to do, and all threads end at about the same time."""


class MachineCode:
    """Compiled equations of a mechanism in one assembly mode."""

    def __init__(self, library: Path, threads: int = 1) -> None:
        """Raises NotCompiled."""
        try:
            self._call = ctypes.CDLL(str(library)).evaluate
        except OSError as error:
            raise NotCompiled(f"{library} cannot be loaded ({error}): delete it") from error
        self._call.restype = None
        self._threads = threads

    def evaluate(self, joints: Array, out: Evaluations) -> None:
        """Fill evaluations of joints (N, n), as `batch.evaluate_many` does without a load."""
        arrays = [np.ascontiguousarray(joints, dtype=float), *[getattr(out, name) for name in ARRAYS]]
        parts = [[array[start : start + PART] for array in arrays] for start in range(0, len(joints), PART)]
        if self._threads == 1:
            for part in parts:
                self._fill(part)
        else:
            with ThreadPoolExecutor(self._threads) as pool:  # a call of a library leaves Python to other threads
                deque(pool.map(self._fill, parts), maxlen=0)

    def _fill(self, arrays: list[Array]) -> None:
        self._call(ctypes.c_int64(len(arrays[0])), *[ctypes.c_void_p(array.ctypes.data) for array in arrays])


def compiled(mechanism: Mechanism, assembly: int, threads: int = 1) -> MachineCode:
    """The equations of a mechanism in one assembly mode as machine code. Raises NotCompiled."""
    try:
        return MachineCode(built(c_source(mechanism, assembly)), threads)
    except NoClosedForm as error:
        raise NotCompiled(f"the equations of {mechanism.kind} are not in closed form") from error


def built(text: str) -> Path:
    """The library of a C source, from the cache if it is there. Raises NotCompiled."""
    glibc = platform.machine() == "x86_64" and platform.libc_ver()[0] == "glibc"
    libraries = ("-lmvec", "-lm") if glibc else ("-lm",)
    command = [*compiler(), *OPTIONS, *VECTORS]
    key = hashlib.sha256("\0".join([text, *command, *libraries, platform.machine()]).encode()).hexdigest()[:32]
    library = cache_folder("machine_code") / f"{key}.so"
    if not library.exists():
        compile_library(text, command, libraries, library)
    return library
