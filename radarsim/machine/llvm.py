"""Choice of an LLVM library that Dr.Jit can use.

Dr.Jit's LLVM back end aborts the process ("Cannot select: fmaximum") with libLLVM 14 to 16 on Sionna RT's kernels, and
it loads the newest library that it finds. This module chooses the library, checks its version, and passes its path in
``DRJIT_LIBLLVM_PATH``.
"""

import ctypes
import glob
import os
import re

from radarize.io.errors import InputError

OLDEST = 19
PACKAGE = "libllvm19"
INSTALL = f"apt-get install {PACKAGE}"
_PATTERNS = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib64/llvm*/lib*/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
)


def version(path: str) -> int:
    """Major version of a libLLVM, from the library (LLVMGetVersion, since 16) or its name; 0 if unreadable."""
    try:
        library = ctypes.CDLL(path)
    except OSError:
        return 0
    try:
        major = ctypes.c_uint()
        library.LLVMGetVersion(ctypes.byref(major), None, None)
        return major.value
    except AttributeError:
        # Without that function it is older than 16, whatever its name is.
        return min(_named_version(path), 15)


def _named_version(path: str) -> int:
    """Major version in a file's name (``libLLVM-14.so.1``, ``libLLVM.so.19.1``), 0 if none."""
    numbers = re.findall(r"\d+", os.path.basename(os.path.realpath(path)))
    return int(numbers[0]) if numbers else 0


def installed() -> list[tuple[int, str]]:
    """List every libLLVM of this machine as (major version by its name, path), newest first, without loading any."""
    paths = {os.path.realpath(path): path for pattern in _PATTERNS for path in glob.glob(pattern)}
    return sorted(((_named_version(path), path) for path in paths.values()), reverse=True)


def find() -> tuple[str, int] | None:
    """Path and major version of the newest usable libLLVM, or of the one in DRJIT_LIBLLVM_PATH."""
    if named := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return named, version(named)
    # Only files with a usable version in their name are opened: several LLVMs in one process may clash.
    for promised, path in installed():
        if promised >= OLDEST and (major := version(path)) >= OLDEST:
            return path, major
    return None


def require() -> tuple[str, int]:
    """Make Dr.Jit use a suitable LLVM; call before anything imports drjit, mitsuba or sionna.

    Returns:
        Path and major version.

    Raises:
        InputError: there is none; the message has the command that installs one.
    """
    found = find()
    if found is None:
        old = sorted({major for major, _ in installed() if major})
        raise InputError(
            f"found {f'only LLVM {old[-1]}' if old else 'no LLVM'} on this machine, expected version {OLDEST} or newer "
            f"for the ray tests; type: {INSTALL}"
        )
    path, major = found
    if major < OLDEST:
        raise InputError(
            f"DRJIT_LIBLLVM_PATH names {path}, which is "
            f"{f'LLVM {major}' if major else 'no readable LLVM'}, expected version {OLDEST} or newer; unset it, or "
            f"type: {INSTALL}"
        )
    os.environ["DRJIT_LIBLLVM_PATH"] = path
    return found
