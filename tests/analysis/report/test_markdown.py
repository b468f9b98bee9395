"""Tables in Markdown."""

from __future__ import annotations

from analysis.report.markdown import markdown_head, markdown_row, markdown_table


def test_table_has_a_rule_below_its_headings():
    rows = [("active", 3), ["none", 0.5]]
    assert markdown_table(("law", "runs"), rows).splitlines() == [
        "| law | runs |",
        "|---|---|",
        "| active | 3 |",
        "| none | 0.5 |",
    ]


def test_a_table_may_be_written_row_by_row():
    lines = [markdown_head(["law"]), markdown_row(["active"])]
    assert "\n".join(lines) == markdown_table(["law"], [["active"]])
