"""What stands in the docs: blocks of code, commands in blocks and in text, links, anchors."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("**/*.md"))]
PROGRAMS = ("taichi-rts", "python", "python3", "make", "pip", "xvfb-run")
FENCE = re.compile(r"^(?:> )?```(\w*)\n(.*?)^(?:> )?```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: str
    language: str
    text: str

    @property
    def file(self):
        """The file that it is the content of, if its first line says so: `# tank.toml`."""
        found = re.match(r"# ([\w.]+\.toml)(, at the end)?\n", self.text)
        return found and found[1]


def read(page):
    return (ROOT / page).read_text(encoding="utf-8")


def name(path):
    return path.relative_to(ROOT).as_posix()


def blocks(page):
    """All fenced blocks of a page."""
    return [
        Block(page, language, re.sub(r"^> ?", "", text, flags=re.MULTILINE))
        for language, text in FENCE.findall(read(page))
    ]


def prose(page):
    """A page without its blocks."""
    return FENCE.sub("", read(page))


def shell_commands(page):
    """Command lines of the shell blocks of a page, each a list of words: two that `&&` joins are two."""
    for block in blocks(page):
        if block.language in ("sh", "bash") or not block.language:
            yield from commands_of(block.text)


def commands_of(text):
    """Command lines in `text` of a block; what looks like a program's output ("taichi-rts: ...") is none."""
    for line in text.replace("\\\n", " ").splitlines():
        if line and not re.match(r"[\w.-]+: |  ", line):
            for part in line.split("&&"):
                if words := shlex.split(part, comments=True):
                    yield words


def inline_commands(page):
    """Commands in backticks in the text of a page; "run|compare" lists what there is and is none."""
    for code in re.findall(r"(?<!`)`([^`]+)`(?!`)", prose(page)):
        code = " ".join(code.split())
        if code.partition(" ")[0] in PROGRAMS and " " in code and "|" not in code:
            yield shlex.split(code, comments=True)


def commands(page):
    """All commands of a page, redirections left out."""
    for words in [*shell_commands(page), *inline_commands(page)]:
        yield words[: words.index(">")] if ">" in words else words


def scene_files(page):
    """Scene files that stand on a page, by name."""
    files = {}
    for block in blocks(page):
        if block.file:
            files[block.file] = files.get(block.file, "") + block.text
    return files


def links(page):
    """Targets of the links and pictures of a page, those to elsewhere left out."""
    found = re.findall(r"\]\(([^)\s]+)\)", prose(page))
    return [target for target in found if not re.match(r"\w+:", target)]


def anchors(page):
    """What GitHub calls the headings of a page."""
    heads = re.findall(r"^#+ (.+)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}
