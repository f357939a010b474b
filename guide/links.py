"""Follows every link within a folder of HTML pages.

Usage: guide/links.py FOLDER

Fails if a page links to a missing file, to a missing heading, or to a folder.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# A guide with fewer links was not built from all its pages.
FEWEST = 500


class Page(HTMLParser):
    """The links and the anchors of a page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(file.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collects an element's links and anchors."""
        for name, value in attrs:
            if value and name in ("href", "src"):
                self.links.append(value)
            elif value and (name == "id" or (name == "name" and tag == "a")):
                self.anchors.add(value)


def main() -> None:
    folder = Path(sys.argv[1]).resolve()
    pages = {file: Page(file) for file in folder.rglob("*.html")}
    followed = 0
    wrong = []
    for file, page in pages.items():
        # The links of the page for missing pages begin at the site's root.
        if file.name in ("404.html", "toc.html"):
            continue
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            followed += 1
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            fragment = unquote(parts.fragment)
            if not target.is_file():
                wrong.append(f"{file.relative_to(folder)}: there is no {link}")
            elif fragment and target in pages and fragment not in pages[target].anchors:
                wrong.append(f"{file.relative_to(folder)}: there is no heading for {link}")
    for line in wrong:
        print(line, file=sys.stderr)
    if followed < FEWEST:
        sys.exit(f"links.py: only {followed} links in {len(pages)} pages")
    if wrong:
        sys.exit(1)
    print(f"{followed} links of {len(pages)} pages lead somewhere")


if __name__ == "__main__":
    main()
