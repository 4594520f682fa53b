"""Finds an LLVM that Dr.Jit can use, before Dr.Jit looks for itself.

Dr.Jit's LLVM back end aborts the process ("Cannot select: fmaximum") with libLLVM 14 to 16 on Sionna RT's kernels, and
it takes the newest library it finds. So the library is chosen and its version checked here, and Dr.Jit is told through
``DRJIT_LIBLLVM_PATH``.
"""

import ctypes
import glob
import os
import re

from radarize.errors import InputError

OLDEST = 19
_PATTERNS = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
)
INSTALL = "apt-get install libllvm19"


def version(path: str) -> int:
    """Major version of a libLLVM, asked of the library itself (LLVMGetVersion, since 16), else 0."""
    try:
        major = ctypes.c_uint()
        ctypes.CDLL(path).LLVMGetVersion(ctypes.byref(major), None, None)
        return major.value
    except (OSError, AttributeError):
        return 0


def find() -> tuple[str, int] | None:
    """Path and major version of the newest usable libLLVM, or of the one that DRJIT_LIBLLVM_PATH names."""
    if named := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return named, version(named)
    # Only files whose name promises a usable version are opened: loading several LLVMs into a process invites clashes.
    candidates = {}
    for pattern in _PATTERNS:
        for path in glob.glob(pattern):
            if (numbers := re.findall(r"\d+", os.path.basename(path))) and int(numbers[0]) >= OLDEST:
                candidates.setdefault(int(numbers[0]), path)
    for _, path in sorted(candidates.items(), reverse=True):
        if (major := version(path)) >= OLDEST:
            return path, major
    return None


def require() -> None:
    """Make Dr.Jit use a suitable LLVM; call before anything imports drjit, mitsuba or sionna.

    Raises:
        InputError: there is none, with the command that installs one.
    """
    found = find()
    if found is None:
        raise InputError(f"no LLVM of version {OLDEST} or newer found, which the ray tests need; type: {INSTALL}")
    path, major = found
    if major < OLDEST:
        raise InputError(
            f"DRJIT_LIBLLVM_PATH names {path}, which is "
            f"{f'LLVM {major}' if major else 'no readable LLVM'}, expected version {OLDEST} or newer; type: {INSTALL}"
        )
    os.environ["DRJIT_LIBLLVM_PATH"] = path
