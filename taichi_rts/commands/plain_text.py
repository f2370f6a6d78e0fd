"""Output to terminals and files whose encoding lacks Greek letters and boxes: plain characters in their place."""

from __future__ import annotations

import codecs
import sys
import unicodedata

HANDLER = "taichi_rts.plain"
WORDS = {
    **{"α": "alpha", "β": "beta", "δ": "delta", "Δ": "d", "ε": "eps", "λ": "lambda", "ν": "nu", "ρ": "rho", "φ": "phi"},
    **{"μ": "u", "µ": "u", "–": "-", "—": "-", "−": "-", "×": "x", "·": ".", "•": "*", "→": "->", "←": "<-", "≥": ">="},
    **{"≤": "<=", "±": "+-", "°": " deg", "√": "sqrt", "²": "^2", "³": "^3", "…": "...", "✓": "ok", "✗": "x"},
    **dict.fromkeys("‘’", "'"),
    **dict.fromkeys("“”", '"'),
}


def plain(text: str) -> str:
    """Return `text` in ASCII: words for Greek letters and signs, lines and corners for boxes, letters without accents."""
    return "".join(_plain(character) for character in text)


def _plain(character: str) -> str:
    if character.isascii():
        return character
    if character in WORDS:
        return WORDS[character]
    if "\u2500" <= character <= "\u257f":  # boxes
        name = unicodedata.name(character)
        level, upright = (
            ("HORIZONTAL" in name or "LEFT" in name or "RIGHT" in name),
            ("VERTICAL" in name or "UP" in name),
        )
        if level and (upright or "DOWN" in name):
            return "+"
        return "|" if upright or "DOWN" in name else "-"
    if "\u2580" <= character <= "\u259f":  # blocks
        return "#"
    return unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode() or "?"


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return plain(error.object[error.start : error.end]), error.end


def use_plain_text() -> None:
    """Let standard output and standard error write what their encoding lacks in plain characters, instead of raising."""
    codecs.register_error(HANDLER, _replace)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # not what a notebook or a test puts in its place
            stream.reconfigure(errors=HANDLER)
