"""The documentation holds: its code runs, its commands parse, its links lead somewhere.

What a block may be, and how a page runs: `tests/doc_pages.py`.
"""

import ast
import re
import runpy
import shlex
import subprocess
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

import imuarray
import imuarray_papers
import mkdocs_hooks
from imuarray import plots
from imuarray.commands.parser import make_parser
from imuarray.model import EFFECTS
from tests import oracles
from tests.doc_pages import FENCE, PAGES, ROOT, Block, blocks, commands, compare, parsed

DOCS = ROOT / "docs"
SLOW = ("recording.md", "effects.md", "tutorial_recording.md", "tutorial_simulated.md")
COMMAND = re.compile(r"`(imuarray [^`]+)`")
CODE = re.compile(r"`([^`]+)`")


def named(pages):
    """Parameters of a test, one a page."""
    return [
        pytest.param(page, id=page.name, marks=[pytest.mark.slow] if page.name in SLOW else [])
        for page in pages
    ]


def outside_code(page: Path) -> str:
    """A page's text without its fenced blocks."""
    inside, lines = False, []
    for line in page.read_text(encoding="utf-8").splitlines():
        fence = FENCE.match(line)
        inside ^= bool(fence)
        lines += [] if inside or fence else [line]
    return "\n".join(lines)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_is_run_or_says_why_not(page):
    for block in blocks(page):
        if block.language == "python":
            ast.parse(block.text)
        if block.kind == "source":
            assert block.text in (ROOT / block.note).read_text(encoding="utf-8"), block.where
    # four spaces are code, too, unless they continue a list
    code = re.findall(r"(?<=\n\n)    .*", outside_code(page))
    assert not code, f"{page.name}: expected fenced blocks, found indented ones: {code}"


@pytest.mark.parametrize(
    "page",
    named(page for page in PAGES if any(block.kind in ("python", "sh") for block in blocks(page))),
)
def test_the_code_runs(page):
    # in a process of its own: a page may add an effect to the catalogue
    run = subprocess.run(
        [sys.executable, "-m", "tests.doc_pages", str(page)],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr


def test_a_page_that_shows_something_else_is_caught():
    block = Block(ROOT / "README.md", 1, "text", "text", "", "sd 10 µm after 3 steps\n")
    compare(block, "sd 11 µm\nafter 3 steps\n")
    for other in ("sd 13 µm after 3 steps", "rms 10 µm after 3 steps", "sd 10 µm after steps"):
        with pytest.raises(ValueError, match="the page shows"):
            compare(block, other)


def test_an_unmarked_block_is_refused(tmp_path):
    for fence in ("```", "```yaml"):
        page = tmp_path / "page.md"
        page.write_text(f"{fence}\na: 1\n```\n")
        with pytest.raises(ValueError, match="page.md:1: expected python"):
            blocks(page)
    block = "```yaml\na: 1\n```\n\n"
    page.write_text(f"<!-- not run: a fragment -->\n{block}`a.yaml`\n\n{block}")
    assert [block.kind for block in blocks(page)] == ["not run", "file"]


def test_every_command_line_parses():
    found = 0
    for page in PAGES:
        for block in blocks(page):
            lines = commands(block.text) if block.language == "sh" else ()
            for line in lines:
                if (known := parsed(line)) is not None:
                    parser, arguments = known
                    parser.parse_args(arguments)
                    found += 1
    assert found > 20


def options_of(parser, words) -> set[str]:
    """The options of the command that ``words`` name, of all commands where they name none."""
    commands = [action for action in parser._actions if hasattr(action.choices, "items")]
    known = {option for action in parser._actions for option in action.option_strings}
    for action in commands:
        chosen = [words[0]] if words and words[0] in action.choices else action.choices
        assert not words or words[0].startswith("-") or words[0] in action.choices, words
        for name in chosen:
            known |= options_of(action.choices[name], words[1:] if words else words)
    return known


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_in_a_sentence_exist(page):
    for line in COMMAND.findall(outside_code(page)):
        words = shlex.split(line)[1:]
        unknown = {word for word in words if word.startswith("--")} - options_of(
            make_parser(), words
        )
        assert not unknown, f"{page.name}: {line}"


def anchors(page: Path) -> set[str]:
    """What a link to a page may end with."""
    text = outside_code(page)
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    slugs = {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}
    return slugs | set(re.findall(r"^::: (\S+)$", text, re.MULTILINE))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    source = page.relative_to(ROOT).as_posix()
    for link in mkdocs_hooks.links(page.read_text(encoding="utf-8")):
        target = mkdocs_hooks.target_of(source, link)
        path = page if target is None else ROOT / target
        if link.startswith(("https:", "mailto:")) or mkdocs_hooks.is_computed(target or ""):
            continue
        assert path.exists(), f"{source}: {link}"
        anchor = link.partition("#")[2]
        assert not anchor or anchor in anchors(path), f"{source}: {link}"


def test_links_as_the_site_has_them():
    text = "[a](../README.md#x) ![b](../paper_figures/b.png) [c](d.md) [e](../results/e.md) [f](#g)"
    assert mkdocs_hooks.rewritten(text, "docs/page.md") == (
        "[a](repository/README.md#x) ![b](repository/paper_figures/b.png) [c](d.md) e [f](#g)"
    )
    assert mkdocs_hooks.rewritten("[a](docs/b.md)", "README.md") == "[a](../b.md)"
    assert mkdocs_hooks.source_of("repository/config/README.md") == "config/README.md"
    taken = mkdocs_hooks.linked_files(["docs/index.md", "docs/pipeline.md"])
    assert {"README.md", "config/README.md", "paper_figures/claims.md"} <= set(taken)


def test_what_a_page_would_fetch_is_seen(tmp_path):
    page = tmp_path / "page.html"
    page.write_text('<a href="https://x.org">x</a><img src="b.png"><p style="color: red">')
    assert mkdocs_hooks.loads_from_elsewhere(tmp_path) == []
    fetching = (
        '<script src="https://x.org/a.js"></script>', '<link rel="icon" href="//x.org/a.png">',
        "<style>@import 'https://x.org/a.css';</style>", '<pre class="mermaid">',
        '<p style="background: url(http://x.org/a.png)">',
    )  # fmt: skip
    for tag in fetching:
        page.write_text(tag)
        assert len(mkdocs_hooks.loads_from_elsewhere(tmp_path)) == 1, tag


def test_figures_are_drawn_by_their_page():
    """In its code, or by a command that it names."""
    shown = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        names = re.findall(r"\]\(images/(\w+\.png)\)", text)
        drawn = set(re.findall(r'savefig\("(\w+\.png)"', text))
        drawn |= set(re.findall(r"`python \S+ \S+ docs/images/(\w+\.png)`", text))
        assert drawn == set(names), page.name
        shown |= set(names)
    assert {path.name for path in (DOCS / "images").glob("*.png")} == shown


def test_the_picture_is_of_the_imports():
    """As `python docs/rooms.py` draws it."""
    picture = (DOCS / "images" / "architecture.svg").read_text(encoding="utf-8")
    shown = re.findall(r">(\w+)</text>", picture)
    known = runpy.run_path(str(DOCS / "rooms.py"))["imports"]()
    assert sorted(shown) == sorted([*(room for _, room in known), "imuarray", "imuarray_papers"])


def resolve(name: str):
    """What a dotted name below a package stands for; None where nothing does."""
    for found in (imuarray, imuarray_papers):
        with suppress(ImportError, AttributeError):
            for part in name.split("."):
                if not hasattr(found, part):
                    import_module(f"{found.__name__}.{part}")
                found = getattr(found, part)
            return found
    return None


def theory_rows() -> list[list[str]]:
    """The cells of the tables in theory.md, without heads and rules."""
    lines = outside_code(DOCS / "theory.md").splitlines()
    rows = [line.strip("|").split(" | ") for line in lines if line.startswith("| ")]
    return [row for row in rows if row[0].strip() not in ("equation", "what")]


def test_the_theory_names_what_exists():
    names = [name for row in theory_rows() for name in CODE.findall(row[-1])]
    assert len(names) > 50
    for name in names:
        oracle = hasattr(oracles, name.removeprefix("tests.oracles."))
        assert name == "motion_sd" or oracle or resolve(name) is not None


def test_the_theory_has_every_equation():
    text = (DOCS / "theory.md").read_text(encoding="utf-8")
    first, second = text.index("## Paper 2017"), text.index("## Paper 2021")
    for part, last in ((text[first:second], 9), (text[second:], 32)):
        named = set()
        for line in part.splitlines():
            cell = line.split(" | ")[0]
            for low, high in re.findall(r"\((\d+)[ab]?\)(?: to \((\d+)\))?", cell):
                named |= set(range(int(low), int(high or low) + 1))
        assert named == set(range(1, last + 1))


def test_the_api_has_every_public_name():
    named = anchors(DOCS / "api.md")
    public = {f"imuarray.{name}": getattr(imuarray, name) for name in imuarray.__all__}
    del public["imuarray.plots"]
    public |= {f"{plots.__name__}.{name}": getattr(plots, name) for name in plots.__all__}
    for name, member in public.items():
        # from its home where a module of the same name stands in a static reader's way
        home = f"{getattr(member, '__module__', '')}.{name.rpartition('.')[2]}"
        assert named & {name, home}, name


def test_the_api_has_every_effect():
    rows = {}
    for line in outside_code(DOCS / "api.md").splitlines():
        if line.startswith("| `"):
            name, *cells = line.strip("| ").split(" | ")
            rows[name.strip("`")] = cells
    # a page that ran before in this process cannot have added one: pages run in their own
    assert set(rows) == set(EFFECTS), "docs/api.md: the table of effects"
    for name, (equation, unit, prior) in rows.items():
        effect = EFFECTS[name]
        written = effect.apply.__doc__.splitlines()[0].replace("``", "`")
        # a bar would end the table's cell
        assert (equation, unit) == (written.replace("|", "and"), effect.unit.replace("|", "and"))
        flat = re.findall(r"[\d.e-]+", str(effect.prior_sd))
        assert {f"{float(number):.3g}" for number in flat} == set(prior.split(", ")), name
