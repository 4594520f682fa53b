from radarize.errors import InputError, reason


def test_a_sentence_is_one_printable_line_of_bounded_length():
    error = InputError("a.cfg: board is \x1b[2J\nx\0, expected one of äß")
    assert str(error) == "a.cfg: board is \\x1b[2J\\nx\\x00, expected one of äß"
    long = str(InputError("a.cfg: numLoops is " + "9" * 5000 + ", expected 1 to 255"))
    assert len(long) < 1010 and long.startswith("a.cfg: numLoops is 99") and long.endswith("9, expected 1 to 255")


def test_reasons_of_libraries():
    assert reason(OSError(13, "Permission denied")) == "Permission denied"
    assert reason(RuntimeError("Can't read\n  (errno = 28)")) == "no space left on the device"
    assert reason(ValueError("bad\x07 magic\n" + "x" * 500)) == ("bad magic " + "x" * 500)[:120]
    assert reason(StopIteration()) == "StopIteration"
