"""Damaged files, as hypothesis strategies: valid ones with edits, spliced with others, and bytes of no file at all."""

import re
from collections.abc import Sequence

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

#: Places are shares of a file's length. Bytes are what hypothesis draws evenly; integers are small, mostly.
_STEPS = 1 << 24
_PLACE = st.binary(min_size=3, max_size=3).map(int.from_bytes)
#: Numbers that counts, lengths and offsets are hardly meant to be.
_ODD = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, -1, -2)
_WORDS = (
    *("", "0", "-1", "1", "2", "255", "65536", "4294967296", "1e3", "1e-300", "1e400", "-1e30", "0.1", "nan", "inf"),
    *("9" * 5000, "0x", "0xFFFFFFFF", "true", "null", "{}", "[]", '"', "%", "\\u0000", "\N{SNOWMAN}", "\x00", "_1"),
)
_WORD = re.compile(r"[^\s,:\[\]{}\"]+")
_ODD_BYTES = st.builds(
    lambda number, size, order: (number % (1 << 8 * size)).to_bytes(size, order),
    st.sampled_from(_ODD),
    st.sampled_from((1, 2, 4, 8)),
    st.sampled_from(("little", "big")),
)
_EDIT = st.tuples(
    st.sampled_from((*4 * ("flip", "overwrite"), "cut", "drop", "insert", "repeat", "splice")),
    _PLACE,
    _PLACE,
    _ODD_BYTES,
)
_TEXT_EDIT = st.tuples(
    st.sampled_from(("replace", "replace", "replace", "drop", "repeat", "exchange", "line", "again")),
    _PLACE,
    _PLACE,
    st.one_of(st.sampled_from(_WORDS), st.integers().map(str), st.floats().map(str), st.text(max_size=5)),
)


def damaged(seeds: Sequence[bytes]) -> SearchStrategy[bytes]:
    """Binary files: valid ones after one to four edits, one time in ten random bytes, with or without a valid start."""

    @st.composite
    def build(draw) -> bytes:
        data = draw(st.sampled_from(seeds))
        if draw(st.integers(0, 9)) == 0:
            return data[: draw(st.sampled_from((0, 0, 4, 16, 64, 512)))] + draw(st.binary(max_size=300))
        for kind, place, other, odd in draw(st.lists(_EDIT, min_size=1, max_size=4)):
            data = _edited(data, kind, place, other, odd, seeds)
        return data

    return build()


def _edited(data: bytes, kind: str, place: int, other: int, odd: bytes, seeds: Sequence[bytes]) -> bytes:
    at = place * len(data) // _STEPS
    length = 1 << other * 11 // _STEPS  # 1 to 1024
    if kind == "flip" and data:
        return data[:at] + bytes([data[at] ^ 1 << other % 8]) + data[at + 1 :]
    if kind == "overwrite":
        return data[:at] + odd + data[at + len(odd) :]
    if kind == "cut":
        return data[:at]
    if kind == "drop":
        return data[:at] + data[at + length :]
    if kind == "insert":
        return data[:at] + odd + data[at:]
    if kind == "repeat":
        return data[:at] + data[at : at + length] + data[at:]
    source = seeds[other % len(seeds)]
    return data[:at] + source[other * len(source) // _STEPS :]


def misspelled(seeds: Sequence[str]) -> SearchStrategy[bytes]:
    """Text files of words and numbers: valid ones after one to four edits of words or lines, or damaged as bytes."""

    @st.composite
    def build(draw) -> bytes:
        text = draw(st.sampled_from(seeds))
        for kind, place, other, word in draw(st.lists(_TEXT_EDIT, min_size=1, max_size=4)):
            text = _respelled(text, kind, place, other, word)
        return text.encode("utf-8", "surrogatepass")

    return st.one_of(build(), build(), damaged([seed.encode() for seed in seeds]))


def _respelled(text: str, kind: str, place: int, other: int, word: str) -> str:
    lines = text.splitlines(keepends=True)
    if kind in ("line", "again") and lines:
        at = place * len(lines) // _STEPS
        return "".join(lines[:at] + (2 * lines[at : at + 1] if kind == "again" else []) + lines[at + 1 :])
    found = list(_WORD.finditer(text))
    if not found:
        return text + word
    here, there = (found[p * len(found) // _STEPS] for p in (place, other))
    new = {"replace": word, "drop": "", "repeat": f"{here[0]} {here[0]}", "exchange": there[0]}.get(kind, word)
    return text[: here.start()] + new + text[here.end() :]
