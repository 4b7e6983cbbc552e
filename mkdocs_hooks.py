"""What MkDocs does not do by itself for this site.

Pages link to files outside docs/ (the README, figures, config/README.md), as a code host shows
them. Such files, and those that they link to in turn, are taken into the site below
``repository/``, and the links follow. At the end no page may load anything from elsewhere.
"""

import posixpath
import re
from contextlib import suppress
from html.parser import HTMLParser
from pathlib import Path

ROOT = Path(__file__).resolve().parent
OUTSIDE = "repository"  # the site's folder for what lies outside docs/

LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\]]*\])*\])\(([^()\s]+)\)")
FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
ELSEWHERE = re.compile(r"^(?:https?:)?//", re.IGNORECASE)
IN_STYLE = re.compile(r"(?:url\(\s*['\"]?|@import\s+['\"])(?:https?:)?//", re.IGNORECASE)


def source_of(uri: str) -> str:
    """The repository's path of a file of the site."""
    inside = uri.removeprefix(f"{OUTSIDE}/")
    return inside if inside != uri else posixpath.join("docs", uri)


def uri_of(source: str) -> str:
    """The site's path of a file of the repository."""
    inside = source.removeprefix("docs/")
    return inside if inside != source else posixpath.join(OUTSIDE, source)


def target_of(source: str, link: str) -> str | None:
    """The repository's path that a link in ``source`` leads to; None for the page and the web."""
    path = link.partition("#")[0]
    if not path or ":" in path:
        return None
    return posixpath.normpath(posixpath.join(posixpath.dirname(source), path))


def is_computed(target: str) -> bool:
    """Not in git, so not in the site, whatever this machine has there."""
    return target.startswith("results/") and target != "results/README.md"


def links(text: str) -> list[str]:
    """The targets of a page's links and pictures, outside its code."""
    return [link for _, link in LINK.findall(FENCED.sub("", text))]


def linked_files(pages: list[str]) -> list[str]:
    """All files outside docs/ that ``pages``, and the pages that they bring along, link to."""
    found, left = [], list(pages)
    while left:
        source = left.pop()
        if not source.endswith(".md"):
            continue
        for link in links((ROOT / source).read_text(encoding="utf-8")):
            target = target_of(source, link)
            if target is None or target.startswith("docs/") or target in found:
                continue
            if (ROOT / target).is_file() and not is_computed(target):
                found.append(target)
                left.append(target)
    return found


def rewritten(text: str, source: str) -> str:
    """A page's text with links as the site has them, to files that are computed as words alone."""
    uri = uri_of(source)

    def moved(match: re.Match) -> str:
        words, link = match.groups()
        target = target_of(source, link)
        if target is None:
            return match[0]
        if is_computed(target):
            return words[1:-1]
        path = posixpath.relpath(uri_of(target), posixpath.dirname(uri) or ".")
        anchor = link.partition("#")[2]
        return f"{words}({path}{'#' if anchor else ''}{anchor})"

    return LINK.sub(moved, text)


class Loads(HTMLParser):
    """What a page loads from elsewhere when it is opened."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            loads = name in ("src", "srcset", "data", "poster") or (name, tag) == ("href", "link")
            if loads and value and ELSEWHERE.match(value):
                self.found.append(f"<{tag} {name}={value}>")
            if name == "class" and value and "mermaid" in value.split():
                self.found.append(f"<{tag} class={value}>, which fetches its script")
            if name == "style" and value and IN_STYLE.search(value):
                self.found.append(f"<{tag} style={value}>")


def loads_from_elsewhere(site: Path) -> list[str]:
    """Scripts, styles, fonts and pictures that the built pages would fetch, with their pages."""
    found = []
    for page in sorted(site.rglob("*.html")):
        parser, text = Loads(), page.read_text(encoding="utf-8")
        parser.feed(text)
        styles = re.findall(r"<style[^>]*>(.*?)</style>", text, re.DOTALL)
        parser.found += ["a <style>"] if any(map(IN_STYLE.search, styles)) else []
        found += [f"{page.relative_to(site)}: {load}" for load in parser.found]
    for sheet in sorted(site.rglob("*.css")):
        if IN_STYLE.search(sheet.read_text(encoding="utf-8")):
            found.append(f"{sheet.relative_to(site)}: a font, picture or style")
    return found


def on_config(config):
    """Types in docstrings are words, shapes and units: not to be parsed as annotations."""
    with suppress(ImportError):  # then they are shown with odd spaces
        from griffe._internal.docstrings import numpy

        numpy.parse_docstring_annotation = lambda text, *_, **__: text


def on_files(files, config):
    """Take in what the pages link to outside docs/."""
    from mkdocs.structure.files import File

    pages = [f"docs/{file.src_uri}" for file in files.documentation_pages()]
    for source in linked_files(pages):
        path = str(ROOT / source)
        files.append(File.generated(config, uri_of(source), abs_src_path=path))
    return files


def on_page_markdown(markdown, page, config, files):
    """Links as the site has them."""
    return rewritten(markdown, source_of(page.file.src_uri))


def on_post_build(config):
    """The promise that the site reads without a network."""
    from mkdocs.exceptions import PluginError

    if found := loads_from_elsewhere(Path(config.site_dir)):
        raise PluginError("pages load from elsewhere:\n" + "\n".join(found))
