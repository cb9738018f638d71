"""How many identifiers of a tree are pronouns, adverbs or bare participles: words that do not say what a thing is."""

import ast
from collections.abc import Iterable, Iterator
from pathlib import Path

WORDS = frozenset(Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").split())


def _identifiers(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Attribute):
            yield node.attr


def share_of_private_words(files: Iterable[Path]) -> float:
    """Of 10 000 identifiers in these files, those that are such a word without their leading underscores."""
    names = [name for path in files for name in _identifiers(ast.parse(path.read_text(encoding="utf-8")))]
    return 1e4 * sum(name.lstrip("_").lower() in WORDS for name in names) / max(len(names), 1)
