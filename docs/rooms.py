"""The picture of docs/architecture.md, drawn from the imports: python docs/rooms.py

A box is a folder of a package, or a file at its top; it rests on boxes above it. Arrows that follow
from others are left out.
"""

import ast
from functools import cache
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

SOURCES = Path(__file__).parents[1] / "src"
PICTURE = Path(__file__).with_name("images") / "architecture.svg"
PACKAGES = {"imuarray": "#0072B2", "imuarray_papers": "#D55E00"}
SHARED = {"errors", "provenance", "streams", "linear", "tails", "caches", "compiled"}
DOORS = {"__init__", "__main__"}
WIDTH, HEIGHT = 1.42, 0.62  # inches a column, a row


def imports() -> dict[tuple[str, str], set[tuple[str, str]]]:
    """(package, room) and what it imports, but for what all use."""
    rooms: dict[tuple[str, str], set[tuple[str, str]]] = {}
    for package in PACKAGES:
        for path in (SOURCES / package).rglob("*.py"):
            own = package, path.relative_to(SOURCES / package).parts[0].removesuffix(".py")
            names = []
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and node.module:
                    names += [f"{node.module}.{alias.name}".split(".") for alias in node.names]
            found = {(name[0], name[1]) for name in names if name[0] in PACKAGES}
            rooms.setdefault(own, set()).update(found - {own})
    kept = [room for room in rooms if room[1] not in SHARED | DOORS]
    return {room: {other for other in rooms[room] if other in kept} for room in kept}


def layers(graph) -> dict:
    """By room, the length of the longest way to one that rests on nothing."""

    @cache
    def depth(room) -> int:
        return 1 + max((depth(other) for other in graph[room]), default=-1)

    return {room: depth(room) for room in graph}


def reduced(graph) -> dict:
    """The imports that do not follow from others."""

    @cache
    def under(room) -> frozenset:
        return frozenset().union(graph[room], *(under(other) for other in graph[room]))

    return {
        room: {x for x in found if not any(x in under(other) for other in found - {x})}
        for room, found in graph.items()
    }


def draw(graph) -> Figure:
    """Rooms row by row, the tool's in blue, the papers' in orange."""
    depths = layers(graph)
    rows: dict[int, list] = {}
    for room in sorted(graph, key=lambda room: (depths[room], room)):
        rows.setdefault(depths[room], []).append(room)
    widest = max(map(len, rows.values()))
    places = {
        room: ((k + (widest - len(row)) / 2 + 0.5) * WIDTH, -depth * HEIGHT)
        for depth, row in rows.items()
        for k, room in enumerate(row)
    }
    figure = Figure(figsize=(widest * WIDTH, len(rows) * HEIGHT))
    axes = figure.add_axes((0, 0, 1, 1))
    for room, found in reduced(graph).items():
        for other in found:
            (x, y), (to_x, to_y) = places[room], places[other]
            axes.plot([x, to_x], [y + 0.14, to_y - 0.14], color="0.75", linewidth=0.8, zorder=0)
    for room, (x, y) in places.items():
        style = {"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": PACKAGES[room[0]]}
        axes.text(x, y, room[1], ha="center", va="center", size=9, bbox=style)
    for number, (package, color) in enumerate(PACKAGES.items()):
        axes.text(0.1, -(len(rows) - 1.4 + 0.5 * number) * HEIGHT, package, color=color, size=10)
    axes.set(xlim=(0, widest * WIDTH), ylim=(-(len(rows) - 0.5) * HEIGHT, HEIGHT / 2))
    axes.set_axis_off()
    return figure


if __name__ == "__main__":
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rooms"}):
        draw(imports()).savefig(PICTURE, metadata={"Date": None})
