"""Detection of raw captures whose words differ from what a DCA1000 writes: signed 16-bit I and Q."""

import numpy as np
from jaxtyping import Int16

#: Minimum number of words for a decision.
_LEAST = 4096
#: In offset binary, whose zero is the sign bit alone, most words have at least half of full scale.
_HALF = 1 << 14
#: Share of a file's numbers that are neither tiny nor huge, above which they are floats; for random words it is a
#: quarter.
_FLOATS = 0.95
_SIGN = np.int16(-(1 << 15))


def signed(words: Int16[np.ndarray, "word"], encoding: str) -> Int16[np.ndarray, "word"]:
    """Convert words of an encoding, ``signed`` or ``offset-binary`` (1 is -32767), to signed; 0 marks lost samples."""
    return np.where(words == 0, words, words ^ _SIGN) if encoding == "offset-binary" else words


def oddity(data: bytes, encoding: str) -> str:
    """Return a sentence on another encoding that the first bytes of a capture clearly have; empty if there is none."""
    data = data[: len(data) // 8 * 8]
    for kind, name in (("<f8", "complex128"), ("<f4", "complex64")):
        values = np.frombuffer(data, kind)
        values = np.abs(values[values != 0])
        with np.errstate(invalid="ignore"):
            if len(values) > _LEAST // 4 and np.mean((values > 1e-9) & (values < 1e9)) > _FLOATS:
                return f"its bytes are probably floating-point numbers ({name}): save them as an array in an .npy file"
    words = signed(np.frombuffer(data, "<i2"), encoding)
    words = words[words != 0].astype(np.int32)  # where packets were lost
    if len(words) < _LEAST:
        return ""
    size = float(np.median(np.abs(words)))
    if size > _HALF and (1 << 15) - size < size / 4:
        right = "signed" if encoding == "offset-binary" else "offset-binary"
        return f"its words are near full scale, so they are probably {right}: use --encoding {right}"
    return ""
