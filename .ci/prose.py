"""Check the prose of pages, docstrings and messages: `python .ci/prose.py [--table]`.

A sentence of a page has at most 35 words, and the mean of a page stays below 20. The words in
BANNED, which have a plainer or more exact equivalent, occur in no page, docstring or message.
`--table` prints the counts of each page and package.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT: Final = Path(__file__).resolve().parents[1]
PACKAGES: Final = ("stimuli", "device", "experiment", "analysis")
MAX_WORDS: Final = 35
MAX_MEAN_WORDS: Final = 20
MIN_SENTENCE_WORDS: Final = 3
MIN_MESSAGE_WORDS: Final = 4
"""A string literal with fewer words is a name or a label."""
BANNED: Final = re.compile(
    r"\b(tells?|told|foretold|anew|whoever|hardly|likewise|beside|nobody|stands|was asked|"
    r"is asked for|are asked for|wanted|requeued?|anticipated|head hash|foreign table|own finger|"
    r"unfit|sitting|as before|no longer)\b",
    re.IGNORECASE,
)
_ABBREVIATIONS: Final = r"(?<!\bal)(?<!\bFig)(?<!e\.g)(?<!i\.e)(?<!\bvol)(?<!\bed)"
_INITIAL: Final = r"(?<!(?<!\d )(?<![-\w])[A-Z])"
"""A capital letter on its own, which is not a unit after a number."""
_SENTENCE_END: Final = re.compile(
    rf"{_INITIAL}{_ABBREVIATIONS}[.!?][)\"*]*\s+(?=[\"(*`_\[]*[A-Z0-9])"
)
_CODE_LINES: Final = re.compile(
    r"(?s)^\s*>>>.*?(?=\n\s*\n|\Z)|^\w+(?:, \w+)* : [^\n]*$", re.MULTILINE
)
"""Examples, and the lines of a docstring that name a parameter or an attribute."""
_FENCE: Final = re.compile(r"(?ms)^ *(`{3,}|:{3,})(?!\{(?:glossary|note|warning)).*?^ *\1\s*$")
_MARKUP: Final = (
    (_FENCE, "\n\n"),
    (re.compile(r"(?m)^`{3,}.*$"), ""),
    (re.compile(r"(?s)<!--.*?-->|\$\$.*?\$\$"), "\n\n"),
    (re.compile(r"(?m)^ {4,}(?![-*\d]).*$"), "\n"),
    (re.compile(r"!\[[^\]]*\]\([^)]*\)"), ""),
    (re.compile(r"\[([^\]]*)\]\([^)]*\)"), r"\1"),
    (re.compile(r"(`+|\$)(?:(?!\1).)+?\1", re.DOTALL), "Code"),
)


class Counts(NamedTuple):
    """The words of one text."""

    name: str
    words: int
    sentences: list[str]
    banned: list[str]

    @property
    def lengths(self) -> list[int]:
        """The words of each sentence."""
        return [len(sentence.split()) for sentence in self.sentences]

    @property
    def mean(self) -> float:
        """The words of a sentence on average."""
        return sum(self.lengths) / max(len(self.lengths), 1)


def paragraphs_of(page: str) -> Iterator[str]:
    """Yield the paragraphs, list items and definitions of a Markdown page, without its tables."""
    for pattern, replacement in _MARKUP:
        page = pattern.sub(replacement, page)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )|\n(?=  \S)|(?<=\|)\n", page):
        text = block.strip().lstrip("-*> ").strip()
        if text and text[0] not in "#|`:":
            yield " ".join(re.sub(r"^\d+\. ", "", text).split())


def sentences_of(paragraphs: Iterator[str]) -> list[str]:
    """Split paragraphs into sentences; fewer words are labels."""
    parts = (part for text in paragraphs for part in _SENTENCE_END.split(text))
    return [part for part in parts if len(part.split()) >= MIN_SENTENCE_WORDS]


def page_counts(path: Path) -> Counts:
    """Return the counts of a Markdown page; banned words count in its tables, too."""
    text = path.read_text("utf-8")
    prose = re.sub(r"`[^`\n]*`", "Code", _FENCE.sub("", text))
    return Counts(
        name=path.relative_to(ROOT).as_posix(),
        words=len(text.split()),
        sentences=sentences_of(paragraphs_of(text)),
        banned=BANNED.findall(prose),
    )


def strings_of(tree: ast.Module) -> Iterator[tuple[str, bool]]:
    """Yield the docstrings of a module, and its other strings that have several words."""
    docstrings = set()
    for node in ast.walk(tree):
        if isinstance(
            node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
        ) and (text := ast.get_docstring(node)):
            docstrings.add(id(node.body[0].value))  # type: ignore[attr-defined]
            yield text, True
    yield from (
        (node.value, False)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in docstrings
        and len(node.value.split()) >= MIN_MESSAGE_WORDS
    )


def package_counts(package: str) -> tuple[Counts, Counts]:
    """Return the counts of the docstrings and of the messages of a package."""
    texts: dict[bool, list[str]] = {True: [], False: []}
    for path in sorted((ROOT / package).rglob("*.py")):
        for text, is_docstring in strings_of(ast.parse(path.read_text("utf-8"))):
            texts[is_docstring].append(_CODE_LINES.sub("", text))
    return tuple(  # type: ignore[return-value]
        Counts(
            name=f"{package} ({kind})",
            words=sum(len(text.split()) for text in texts[key]),
            sentences=[s for text in texts[key] for s in sentences_of(paragraphs_of(text))],
            banned=[word for text in texts[key] for word in BANNED.findall(text)],
        )
        for key, kind in ((True, "docstrings"), (False, "messages"))
    )


def main() -> int:
    """Print each fault; return 1 if there is any."""
    pages = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "firmware/README.md")]
    pages += sorted((ROOT / "docs").rglob("*.md"))
    generated = {ROOT / "docs" / name for name in ("reference", "figures", "benchmarks")}
    counts = [page_counts(page) for page in pages if not generated & {*page.parents}]
    code = [entry for package in PACKAGES for entry in package_counts(package)]
    if "--table" in sys.argv:
        for entry in [*counts, *code]:
            longest = max(entry.lengths, default=0)
            print(
                f"{entry.words:6} {entry.mean:5.1f} {longest:3} {len(entry.banned):4} {entry.name}"
            )
        print(f"{sum(entry.words for entry in counts):6}")
    faults = [
        f"{entry.name}: {len(sentence.split())} words, at most {MAX_WORDS}: {sentence}"
        for entry in counts
        for sentence in entry.sentences
        if len(sentence.split()) > MAX_WORDS
    ]
    faults += [
        f"{entry.name}: a mean of {entry.mean:.1f} words, must be below {MAX_MEAN_WORDS}"
        for entry in counts
        if entry.mean >= MAX_MEAN_WORDS
    ]
    faults += [
        f"{entry.name}: banned words: {', '.join(entry.banned)}"
        for entry in [*counts, *code]
        if entry.banned
    ]
    print("\n".join(faults), end="\n" if faults else "")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
