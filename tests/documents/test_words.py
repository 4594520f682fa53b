"""The check of words finds a bad sentence, and leaves exceptions and written pages alone."""

import pytest

from docs import words


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("The position is off by 0.2 m, as nobody knows the heading.", ["'off by'", "'knows'"]),
        ("It TELLS the turn.", ["'TELLS'"]),
        ("Mean ATE is 0.2 m; the heading is unobservable.", []),
        ("A lamp that is switched off by a relay; arms and legs swing.", []),
        ("Apart from that, apart.", []),
        ("class Apart:", ["'Apart'"]),
        ("<!-- Written by a script -->\nIt says so.", []),
    ],
)
def test_words_of_a_sentence(tmp_path, text, found):
    page = tmp_path / "page.md"
    page.write_text(text)
    assert [line.split(": ")[1] for line in words.findings(page, *words.rules())] == found


def test_the_exit_status(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("An error of 0.2 m.\n")
    assert words.main([str(page)]) == 0 and "nothing found" in capsys.readouterr().out
    page.write_text("\nIt says so.\n")
    assert words.main([str(page)]) == 1 and f"{page}:2: 'says'" in capsys.readouterr().out
