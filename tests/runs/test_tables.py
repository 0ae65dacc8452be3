"""Tables: the same numbers as text, CSV and LaTeX."""

import csv
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runs.measures.statistics import overall, pairwise, summarise
from runs.report.comparison_tables import overall_table, pairs_table, summary_table
from runs.report.tables import ESCAPES, Head, PrintedNumber, escaped, latex_number, short, table

EXAMPLE = table(
    [Head("case", grouped=True), "solver", Head("GD", "1", digits=2), "runs"],
    [["orbit_rise", "MACS", 1.234e-4, 30], ["orbit_rise", "A & B", np.inf, np.int64(3)], ["goddard", "MACS", None, 0]],
    caption="100 % of the runs",
    notes=["Failed runs are worst."],
)


def test_the_same_numbers_as_text_csv_latex_markdown_and_in_files(tmp_path):
    assert EXAMPLE.text().splitlines() == [
        "100 % of the runs",
        "",
        "case        solver       GD  runs",
        "                        [1]",
        "----------  ------  -------  ----",
        "orbit_rise  MACS    1.2e-04    30",
        "            A & B       inf     3",
        "goddard     MACS          -     0",
        "",
        "Failed runs are worst.",
    ]
    rows = list(csv.reader(io.StringIO(EXAMPLE.csv())))
    assert rows[0] == ["case", "solver", "GD [1]", "runs"]
    assert rows[1:] == [["orbit_rise", "MACS", "0.0001234", "30"], ["orbit_rise", "A & B", "inf", "3"], ["goddard", "MACS", "", "0"]]
    written = EXAMPLE.latex("tab:one")
    assert r"\caption{100 \% of the runs}" in written and r"\label{tab:one}" in written
    assert r"\begin{tabular}{llrr}" in written
    assert r"orbit\_rise & MACS & $1.2 \times 10^{-4}$ & $30$ \\" in written
    assert r" & A \& B & $\infty$ & $3$ \\" in written and r"goddard & MACS & -- & $0$ \\" in written
    assert [written.count(rule) for rule in (r"\toprule", r"\midrule", r"\bottomrule")] == [1, 1, 1]
    text = table([Head("name"), Head("size", "m")], [["a|b", 1.5], ["c", None]], "A caption.", ["A note."]).markdown()
    rows = ["| name | size [m] |", "| :--- | ---: |", r"| a\|b | 1.50 |", "| c | - |"]
    assert text.splitlines() == ["**A caption.**", "", *rows, "", "A note."]
    paths = EXAMPLE.save(tmp_path / "table.3")
    assert [path.name for path in paths] == ["table.3.txt", "table.3.csv", "table.3.tex"]
    assert paths[0].read_text() == EXAMPLE.text() + "\n" and paths[2].read_text() == EXAMPLE.latex("tab:table.3")
    with pytest.raises(ValueError, match="row 1 has 1 cells, the table 2 columns"):
        table(["a", "b"], [[1, 2], [1]])


@pytest.mark.parametrize(
    ("value", "text", "latex"),
    [
        (0.0, "0", "$0$"),
        (-12.345, "-12.3", "$-12.3$"),
        (999.6, "1000", "$1000$"),
        (0.05, "0.0500", "$0.0500$"),
        (1.5e-7, "1.50e-07", r"$1.50 \times 10^{-7}$"),
        (110_000.0, "110000", "$110000$"),
        (110_000.5, "1.10e+05", r"$1.10 \times 10^{5}$"),
        (-3e12, "-3.00e+12", r"$-3.00 \times 10^{12}$"),
        (np.nan, "-", "--"),
        (-np.inf, "-inf", r"$-\infty$"),
        (PrintedNumber(2773.92), "2773.92", "$2773.92$"),
    ],
)
def test_numbers(value, text, latex):
    assert short(value) == text and latex_number(value) == latex


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e300, max_value=1e300), st.integers(1, 8))
def test_numbers_keep_their_digits(value, digits):
    assert float(short(value, digits)) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits))


@given(st.text(alphabet='\\&%$#_{}~^<>|"²³±×°−≤≥ab[]', max_size=20))
def test_words_hold_nothing_that_latex_obeys(text):
    rest = escaped(text)
    for command in sorted({written for written in ESCAPES.values() if len(written) > 2}, key=len, reverse=True):
        rest = rest.replace(command, "")
    for character in "&%$#_{}":
        rest = rest.replace(f"\\{character}", "")
    assert not set(rest) & set("\\&%$#_{}~^<>")


def test_tables_of_statistics_say_what_the_statistics_are():
    samples = {
        "igd": {"ours": [1.0, 2.0, 3.0], "theirs": [4.0, np.inf, 6.0], "others": [2.0, 2.0, 2.0]},
        "hypervolume": {"ours": [0.9, 0.8, 0.9], "theirs": [0.7, 0.0, 0.6], "others": [0.9, 0.9, 0.9]},
    }
    summary = summary_table(samples, caption="goddard")
    first = summarise(samples["igd"]["theirs"])
    assert summary.rows[1][:6] == ("igd", "theirs", 3, 1, first.mean, first.variance) and summary.rows[1][-1] == np.inf
    assert summary.rows[3][-2:] == (0.9, 0.8), "of the hypervolume, the largest is best"
    assert "divisor n - 1" in summary.notes[0] and "failed runs are worse" in summary.notes[1]
    pairs = pairs_table(samples)
    for row, c in zip(pairs.rows[:3], pairwise(samples["igd"]), strict=True):
        assert row[3:7] == (c.p, c.p_holm, c.a12, c.effect) and row[7] == "neither"
    assert "cannot be below 0.3" in pairs.notes[1]
    many = {"igd": {name: list(np.arange(10.0) + shift) for name, shift in (("ours", 0.0), ("theirs", 20.0))}}
    assert pairs_table(many).rows[0][-1] == "ours"
    assert pairs_table({"hypervolume": many["igd"]}).rows[0][-1] == "theirs"
    together = overall_table(samples)
    assert [column.title for column in together.columns][3:] == ["rank of ours", "rank of theirs", "rank of others"]
    assert together.rows[0][0] == "igd" and "Kruskal-Wallis" in together.notes[0]
    assert together.rows[0][3:] == tuple(overall(samples["igd"]).ranks.values())
