"""Finds wording in docs and messages that an English reader must read twice.

``python -m tools.prose`` reads README, CONTRIBUTING and docs, and every text for people
in the shipped code: messages of errors and warnings, and help of commands. In
``systems`` and ``diagrams``, it also reads docstrings and comments. Exit status 1 if
there is any. `# prose: ok` ends a line of code whose text stays as it is.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("systems", "diagrams", "analysis", "phonotaxis")
#: Packages whose docstrings and comments are read, too.
READ_WHOLE = ("systems", "diagrams")

#: What to write instead, by pattern.
PATTERNS = {
    r"in the place of": "instead of",
    r"\b(?:is|are|was|were|be|been) told\b|\btells?\b|\btelling\b": (
        "report, state, distinguish"
    ),
    r"\b[Ww]hat (?:rests|moves|echoes|remains|drives|stands|sounds|is left|comes)\b": (
        "name the thing: obstacles at rest, the remaining error"
    ),
    r"\b(?:rows?|lines?|values?|pictures?|cells?|samples?|layouts?|recordings?|trials?"
    r"|frames?|draws|estimates?|starts?|sources?|times) an? (?:tick|frame|run|law|row"
    r"|cell|layout|robot|burst|recording|microphone|channel|sensor|scenario|second"
    r"|minute|hour|step|period)\b": "one X per Y",
    r"\b(?:m|s|ms|us|MB|N|rad|deg) an? (?:tick|frame|run|law|row|second|step)\b": "per",
    r"\bbut for\b": "except for, apart from",
    r"\bhangs? on\b": "depends on",
    r"\bwhence\b|\bthereof\b": "from where, of it",
    r"\b[Mm]aster(?: robot)?s?\b|\bslave\b": "leader, follower",
    r"\b(?:colour|centre|metre|behaviour|odour|neighbour|licence|linearis|localis"
    r"|normalis|optimis|summaris|recognis|initialis|discretis|artefact|grey|travell"
    r"|modell|labell|fulfil\b|draught|judgement)\w*": "American spelling",
    r"\banalyse[dr]?\b": "analyze",
    r"\bOf (?:the|all|these|several|two|each)\b[^.]{0,60}, ": (
        "put the subject first: 'Ten of the ...'"
    ),
    r"\bwhoever\b": "anything that",
    r"\b(?:of|than) ours\b|\bours is\b": "our law, our estimator",
    r"\bthe same of\b|\bthe like\b": "repeat the noun",
    r"\bsuch as it is\b|\bas it were\b|\bso to speak\b": "leave it out",
    r"\basked for\b(?! by)|\bis asked of\b": "required, requested",
    r"\bstands? in (?:the|a|its)\b": "is in",
    r"\bhold(?:s|ing)? for (?:what|who)": "applies to",
    r"(?m)^[ \t]*%(?=[ ,.;:)])": "move % up: pages omit this line as a comment",
    r"[—–]": "a colon, a comma or two sentences",  # noqa: RUF001
}
_OWN = [(re.compile(pattern), hint) for pattern, hint in PATTERNS.items()]


class Finding(NamedTuple):
    """A place to reword."""

    file: str
    line: int
    words: str
    hint: str


def found_in(text: str) -> Iterator[tuple[int, str, str]]:
    """Line, from 0, words and hint of each place in a text."""
    for pattern, hint in _OWN:
        for match in pattern.finditer(text):
            yield text.count("\n", 0, match.start()), match[0], hint


def prose_of_page(text: str) -> str:
    """A page without code, formulas, generated blocks, and targets of links."""

    def blank(match: re.Match[str]) -> str:
        return "\n" * match[0].count("\n")

    for pattern in (
        r"(?ms)^```.*?^```$",
        r"(?s)<!-- (?:results|lines|generated): .*?<!-- end -->",
        r"(?s)<!--.*?-->",
        r"(?s)\$\$.*?\$\$",
        r"`[^`\n]*`",
        r"\$[^$\n]*\$",
        r"\]\([^)]*\)",
    ):
        text = re.sub(pattern, blank, text)
    return text


def pages() -> list[Path]:
    """What people read beside the code."""
    names = ["README.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md"]
    return [*(ROOT / name for name in names), *sorted((ROOT / "docs").glob("*.md"))]


def messages(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of what a module says to people: strings of four words or more."""
    source = path.read_text("utf-8")
    lines, tree = source.splitlines(), ast.parse(source)
    quiet = {id(part) for node in ast.walk(tree) for part in _no_texts(node)}
    for node in ast.walk(tree):
        if id(node) in quiet or not isinstance(node, ast.Constant | ast.JoinedStr):
            continue
        text = _words(node)
        if text.count(" ") >= 3 and not lines[node.lineno - 1].endswith("# prose: ok"):
            yield node.lineno, text


def remarks(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring and of each block of comments in a module."""
    source = path.read_text("utf-8")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            text = node.value.value
            if isinstance(text, str):
                # Names of arguments are identifiers.
                text = re.sub(r"(?m)^( +)\*{0,2}\w+:", r"\1:", text)
                yield node.lineno, prose_of_page(text.replace("``", "`"))
    above, block = -1, list[str]()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT:
            continue
        line = token.start[0]
        if block and line != above + 1:
            yield above - len(block) + 1, prose_of_page("\n".join(block))
            block = []
        block.append(token.string.lstrip("#: "))
        above = line
    if block:
        yield above - len(block) + 1, prose_of_page("\n".join(block))


def _no_texts(node: ast.AST) -> Iterator[ast.AST]:
    """Docstrings, and parts of formatted strings."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        yield from node.values


def _words(node: ast.expr) -> str:
    """Its constant parts; what is put in is a word."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(_words(part) for part in node.values)
    return "X" if isinstance(node, ast.FormattedValue) else ""


def findings() -> list[Finding]:
    """All of them, by file and line."""
    found = []
    for page in pages():
        name = str(page.relative_to(ROOT))
        for line, words, hint in found_in(prose_of_page(page.read_text("utf-8"))):
            found.append(Finding(name, line + 1, words, hint))
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = str(path.relative_to(ROOT))
            for line, text in messages(path):
                for _, words, hint in found_in(text):
                    found.append(Finding(name, line, words, hint))
            for line, text in remarks(path) if package in READ_WHOLE else ():
                for below, words, hint in found_in(text):
                    found.append(Finding(name, line + below, words, hint))
    return sorted(found)


def main() -> int:
    """Prints them.

    Returns:
        Exit status: 1 if there is any.
    """
    found = findings()
    for each in found:
        print(f"{each.file}:{each.line}: {each.words!r}: write {each.hint}")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
