"""Rewrite one place of a function by a rule on its syntax tree, such as ``A - B -> A + B``.

A rule is two pieces of Python around an arrow. A capital letter is a placeholder: it stands for any expression, and the
same letter for equal ones. All else is compared node by node. Spaces, comments, line breaks and the names that
placeholders stand for do not matter, so that a rule finds its place after most renamings. A pattern must match once, or
as often as the rule says in front: ``2 of 3: A - B -> A + B`` changes the second of three places."""

from __future__ import annotations

import ast
import copy
import re
from dataclasses import dataclass

PLACEHOLDER = re.compile(r"[A-Z]")
CONTEXT = re.compile(r", ctx=\w+\(\)")  # of a name: whether it is read or written
RULE = re.compile(r"(?:(?P<number>\d) of (?P<count>\d): )?(?P<pattern>.+) -> (?P<replacement>.+)", re.DOTALL)
Bindings = dict[str, ast.AST]


@dataclass(frozen=True)
class Rule:
    """pattern, replacement : expressions or statements; number : of the match that is changed, of `count` matches."""

    pattern: ast.AST
    replacement: ast.AST
    number: int = 1
    count: int = 1

    @classmethod
    def parse(cls, text: str) -> Rule:
        """A rule from its text."""
        parts = RULE.fullmatch(text)
        if parts is None:
            raise ValueError(f"a rule is `pattern -> replacement`: {text}")
        pattern, replacement = _parsed(parts["pattern"]), _parsed(parts["replacement"])
        if unbound := _placeholders(replacement) - _placeholders(pattern):
            raise ValueError(f"{', '.join(sorted(unbound))} stand in the replacement alone: {text}")
        return cls(pattern, replacement, int(parts["number"] or 1), int(parts["count"] or 1))


def rewritten(source: str, place: str, rule: Rule) -> ast.Module:
    """The tree of a module in which the rule has replaced the one node of a function that matches.

    place : name of the function, `Class.method` for a method, "" for the statements of the module outside functions
    Raises  ValueError where the module has no such function, or the pattern does not match as often as the rule says"""
    module = ast.parse(source)
    nodes = list(_nodes(module, place))
    matches = [(node, bindings) for node in nodes if (bindings := match(rule.pattern, node)) is not None]
    if len(matches) != rule.count:
        times = f"{len(matches)} times instead of {rule.count}"
        raise ValueError(f"{place or 'the module'} matches {ast.unparse(rule.pattern)} {times}")
    node, bindings = matches[rule.number - 1]
    updated = ast.copy_location(_Filled(bindings).visit(copy.deepcopy(rule.replacement)), node)
    _replace(module, node, ast.fix_missing_locations(updated))
    return module


def match(pattern: ast.AST, node: ast.AST, bindings: Bindings | None = None) -> Bindings | None:
    """What the placeholders of a pattern stand for in a node; None where it does not match."""
    bindings = {} if bindings is None else bindings
    if isinstance(pattern, ast.Name) and PLACEHOLDER.fullmatch(pattern.id):
        bound = bindings.setdefault(pattern.id, node)
        return bindings if isinstance(node, ast.expr) and _text(bound) == _text(node) else None
    if type(pattern) is not type(node):
        return None
    for name, value in ast.iter_fields(pattern):
        if name not in ("ctx", "type_comment", "kind") and not _equal(value, getattr(node, name), bindings):
            return None
    return bindings


def _equal(pattern: object, value: object, bindings: Bindings) -> bool:
    """Whether two fields of nodes are equal: nodes, lists of nodes, or plain values."""
    if isinstance(pattern, ast.AST):
        return isinstance(value, ast.AST) and match(pattern, value, bindings) is not None
    if isinstance(pattern, list):
        return (
            isinstance(value, list)
            and len(pattern) == len(value)
            and all(_equal(a, b, bindings) for a, b in zip(pattern, value, strict=True))
        )
    return pattern == value


def _text(node: ast.AST) -> str:
    """A node as text, whether it is read or written."""
    return CONTEXT.sub("", ast.dump(node))


def _placeholders(pattern: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(pattern) if isinstance(n, ast.Name) and PLACEHOLDER.fullmatch(n.id)}


class _Filled(ast.NodeTransformer):
    """Put what they stand for in place of the placeholders."""

    def __init__(self, bindings: Bindings):
        self._bindings = bindings

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """Called by ast."""
        updated = copy.deepcopy(self._bindings.get(node.id, node))
        if hasattr(updated, "ctx"):
            updated.ctx = node.ctx
        return updated


def _parsed(text: str) -> ast.AST:
    """An expression or one statement."""
    (statement,) = ast.parse(text.strip()).body
    return statement.value if isinstance(statement, ast.Expr) else statement


def _nodes(module: ast.Module, place: str) -> list[ast.AST]:
    """All nodes of a function, or of the module outside functions."""
    body: list[ast.stmt] = module.body
    for part in place.split(".") if place else ():
        scope = next((n for n in body if isinstance(n, ast.FunctionDef | ast.ClassDef) and n.name == part), None)
        if scope is None:
            raise ValueError(f"the module has no function {place}")
        body = scope.body
    statements = [n for n in body if place or not isinstance(n, ast.FunctionDef | ast.ClassDef)]
    nodes = [node for statement in statements for node in ast.walk(statement) if hasattr(node, "lineno")]
    return sorted(nodes, key=lambda node: (node.lineno, node.col_offset))  # type: ignore[attr-defined]


def _replace(tree: ast.AST, old: ast.AST, new: ast.AST) -> None:
    """Put a node in the place of another."""
    for parent in ast.walk(tree):
        for name, value in ast.iter_fields(parent):
            if value is old:
                setattr(parent, name, new)
            elif isinstance(value, list) and any(item is old for item in value):
                setattr(parent, name, [new if item is old else item for item in value])
