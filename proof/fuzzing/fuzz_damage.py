"""Damage to a file: to its lines, to tables of a TOML file, to its bytes."""

import re

import numpy as np

DAMAGES = ("flips", "cut", "doubled block", "lost block", "byte order mark", "UTF-16", "zeros")

LINE_DAMAGES = ("gone", "doubled", "swapped", "cut off", "number", "character", "word")


def bytes_damaged(content: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """A content with one or two damages that transport, editors and other programs do, and what they are."""
    done = [str(kind) for kind in rng.choice(DAMAGES, int(rng.integers(1, 3)))]
    for kind in done:
        i, j = sorted(int(k) for k in rng.integers(len(content) + 1, size=2))
        near = min(j, i + 400)
        flipped = bytearray(content)
        for k in rng.integers(max(len(content), 1), size=min(len(content), int(rng.integers(1, 9)))):
            flipped[k] ^= 1 << int(rng.integers(8))
        content = {
            "flips": bytes(flipped),
            "cut": content[:j],
            "doubled block": content[:j] + content[i:],
            "lost block": content[:i] + content[near:],
            "byte order mark": b"\xef\xbb\xbf" + content,
            "UTF-16": content.decode("latin-1").encode("utf-16"),
            "zeros": content[:i] + bytes(near - i) + content[near:],
        }[kind]
    return content, ", ".join(done)


def lines_damaged(text: str, rng: np.random.Generator) -> tuple[str, str]:
    """A text with one to three damages to its lines, and what they are."""
    done = []
    for kind in map(str, rng.choice(LINE_DAMAGES, int(rng.integers(1, 4)))):
        lines = text.splitlines(keepends=True) or [""]
        i, j = (int(k) for k in rng.integers(len(lines), size=2))
        line, words = lines[i], lines[i].rstrip("\n").split(",")
        at, word = int(rng.integers(len(line) + 1)), int(rng.integers(len(words)))
        spans = [match.span() for match in re.finditer(r"[-+]?\d[\d.eE+-]*", line)] or [(at, at)]
        start, end = spans[int(rng.integers(len(spans)))]
        value = str(rng.choice(["-1", "0", "1e300", "nan", "3.5", "99999999999", "1e-300", "x"]))
        lines[i : None if kind == "cut off" else i + 1] = {
            "gone": [],
            "doubled": [line, line],
            "swapped": [lines[j]],
            "cut off": [line[:at]],
            "number": [line[:start] + value + line[end:]],
            "character": [line[:at] + chr(int(rng.integers(1, 256))) + line[at + 1 :]],
            "word": [",".join([*words[:word], *words[word + 1 :]]) + "\n"],
        }[kind]
        if kind == "swapped":
            lines[j] = line
        text = "".join(lines)
        done.append(f"line {i + 1} {kind}")
    return text, ", ".join(done)


def tables_damaged(text: str, rng: np.random.Generator) -> tuple[str, str]:
    """A TOML text with a whole table gone, doubled or renamed."""
    parts = re.split(r"(?m)^(?=\[)", text)
    i = int(rng.integers(len(parts)))
    kind = str(rng.choice(["gone", "doubled", "renamed", "emptied"]))
    changed = {
        "gone": [],
        "doubled": [parts[i], parts[i]],
        "renamed": [re.sub(r"\[(\w)", r"[x\1", parts[i], count=1)],
        "emptied": [parts[i].split("\n")[0] + "\n"],
    }
    return "".join([*parts[:i], *changed[kind], *parts[i + 1 :]]), f"table {parts[i][:30].splitlines()[:1]} {kind}"
