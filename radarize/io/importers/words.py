"""What the words of a raw capture look like, where they are not what a DCA1000 writes: signed 16-bit I and Q."""

import numpy as np
from jaxtyping import Int16

#: Fewer words tell nothing.
_LEAST = 4096
#: Words of half of full scale or more are the rule in offset binary, whose zero is the sign bit alone.
_HALF = 1 << 14
#: Share of a file's numbers that are neither tiny nor huge, from which on they are floats: of random words, a quarter.
_FLOATS = 0.95
_SIGN = np.int16(-(1 << 15))


def signed(words: Int16[np.ndarray, "word"], encoding: str) -> Int16[np.ndarray, "word"]:
    """Words of an encoding, ``signed`` or ``offset-binary`` (1 is -32767), as signed ones; 0 is what was lost."""
    return np.where(words == 0, words, words ^ _SIGN) if encoding == "offset-binary" else words


def oddity(data: bytes, encoding: str) -> str:
    """What a capture's first bytes plainly are instead, and what reads them; empty if nothing."""
    data = data[: len(data) // 8 * 8]
    for kind, name in (("<f8", "complex128"), ("<f4", "complex64")):
        values = np.frombuffer(data, kind)
        values = np.abs(values[values != 0])
        with np.errstate(invalid="ignore"):
            if len(values) > _LEAST // 4 and np.mean((values > 1e-9) & (values < 1e9)) > _FLOATS:
                return f"its bytes look like floating-point numbers ({name}); an array of them in an .npy file is read"
    words = signed(np.frombuffer(data, "<i2"), encoding)
    words = words[words != 0].astype(np.int32)  # where packets were lost
    if len(words) < _LEAST:
        return ""
    size = float(np.median(np.abs(words)))
    if size > _HALF and (1 << 15) - size < size / 4:
        right = "signed" if encoding == "offset-binary" else "offset-binary"
        return f"its words lie near full scale, as of {right} words read otherwise; --encoding {right} reads those"
    return ""
