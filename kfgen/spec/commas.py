"""Expressions that stand unquoted in `{...}` or `[...]`, where YAML splits them at their commas."""

from __future__ import annotations

from collections.abc import Sequence

from kfgen.spec.nodes import Bad, Node, Scalar
from kfgen.spec.problems import Problems, short

Pair = tuple[Scalar | Bad, Node]

_QUOTE = "quote the expression"
_WINDOW = 50  # entries of a list that one split expression may have become


def joined_pairs(pairs: Sequence[Pair], path: str, problems: Problems) -> list[Pair]:
    """`{th: atan2(py, px)}` is two keys to YAML: say so once, where the expression begins."""
    joined: list[Pair] = []
    i = 0
    while i < len(pairs):
        key, value = pairs[i]
        i += 1
        prefix = f"{path}." if path else ""
        name = key.text if isinstance(key, Scalar) else ""
        depth = _open_parentheses(value)
        pieces = [value.text] if isinstance(value, Scalar) else []
        end = i
        while depth > 0 and end < len(pairs) and _is_piece(*pairs[end]):
            piece = pairs[end][0]
            assert isinstance(piece, Scalar)
            pieces.append(piece.text)
            depth += _open_parentheses(piece)
            end += 1
        if end > i:
            at = problems.at(value.line, value.column, prefix + name)
            whole = ", ".join(pieces)
            problems.add(
                at,
                f"the comma in {short(whole, 60)} splits the expression into two keys",
                f'{_QUOTE}: `{name}: "{whole}"`',
            )
            value, i = Bad(value.line, value.column), end
        elif isinstance(key, Scalar) and _is_piece(key, value):
            at = problems.at(key.line, key.column, prefix + name)
            empty = isinstance(value, Scalar) and value.kind == "null"
            what = "has no value" if empty else "holds a parenthesis or a bracket"
            hint = f"{_QUOTE} if a comma of it stands here, or write a value"
            problems.add(at, f"the key {short(name)} {what}", hint)
            if not empty or not name.isidentifier():
                continue
            value = Bad(value.line, value.column)
        joined.append((key, value))
    return joined


def join_items(items: list[Node], path: str, problems: Problems) -> None:
    """`[atan2(py, px), 1]` is three entries to YAML: say so once, and put one Bad in place of the pieces."""
    for i, item in enumerate(items):
        depth = _open_parentheses(item)
        end = i + 1
        while depth > 0 and end < min(len(items), i + _WINDOW) and isinstance(items[end], Scalar):
            depth += _open_parentheses(items[end])
            end += 1
        if end > i + 1 and depth == 0:
            whole = ", ".join(n.text for n in items[i:end] if isinstance(n, Scalar))
            at = problems.at(item.line, item.column, f"{path}[{i}]")
            text = f"the comma in {short(whole, 60)} splits the expression into two entries"
            problems.add(at, text, f'{_QUOTE}: "{whole}"')
            items[i:end] = [Bad(item.line, item.column)]
            return


def _open_parentheses(node: Node) -> int:
    if not isinstance(node, Scalar) or not node.plain:
        return 0
    return node.text.count("(") - node.text.count(")")


def _is_piece(key: Scalar | Bad, value: Node) -> bool:
    """Whether a pair of a flow mapping looks like the rest of an expression that a comma split."""
    if not isinstance(key, Scalar) or not key.plain:
        return isinstance(key, Scalar) and isinstance(value, Scalar) and value.kind == "null"
    return "(" in key.text or ")" in key.text or (isinstance(value, Scalar) and value.kind == "null")
