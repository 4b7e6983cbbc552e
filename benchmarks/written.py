"""What both benchmarks do with their result."""

from __future__ import annotations

from pathlib import Path

from imuarray.provenance import atomic_write


def publish(text: str, path: Path) -> None:
    """Print a text and write it, whole or not at all."""
    print(text)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
