"""bracket.stl: an L of two legs, 10 mm thick and 20 mm wide, with a fillet of 10 mm between them, and
beam.stl: a straight beam, 40 mm long, 10 mm thick and 10 mm wide.

    python3 make_surface.py [FILE [SEGMENTS]]      SEGMENTS: of the fillet, 24 if not given, 0 for
                                                   the beam

In millimetres. The solids are `wall` (the back, x = 0), `tip` (the end, x = 80 or 40) and `rest`.
"""
import math
import sys

WIDTH, THICK, LONG, HIGH, FILLET = 20.0, 10.0, 80.0, 60.0, 10.0
BEAM_WIDTH, BEAM_LONG = 10.0, 40.0


def profile(segments):
    """The corners of the side in x and z, turning to the left, from (0, 0); of the beam with 0."""
    if segments == 0:
        return [(0.0, 0.0), (BEAM_LONG, 0.0), (BEAM_LONG, THICK), (0.0, THICK)]
    centre = THICK + FILLET
    arc = [(centre + FILLET * math.cos(angle), centre + FILLET * math.sin(angle)) for angle in
           (math.pi * (1.5 - 0.5 * k / segments) for k in range(segments + 1))]
    return [(0.0, 0.0), (LONG, 0.0), (LONG, THICK), *arc, (THICK, HIGH), (0.0, HIGH)]


def width_of(segments):
    """The width of the part with that many segments."""
    return WIDTH if segments else BEAM_WIDTH


def area(corners):
    """The area of a polygon."""
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, corners[1:] + corners[:1]))


def triangles(corners):
    """A polygon cut into triangles, ear by ear."""
    def turn(a, b, c):
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    left, found = list(corners), []
    while len(left) > 3:
        for i in range(len(left)):
            a, b, c = left[i - 1], left[i], left[(i + 1) % len(left)]
            others = [p for p in left if p not in (a, b, c)]
            if turn(a, b, c) > 0 and not any(min(turn(a, b, p), turn(b, c, p), turn(c, a, p)) >= 0
                                             for p in others):
                found.append((a, b, c))
                left.pop(i)
                break
        else:
            raise ValueError("this polygon has no ear")
    return [*found, tuple(left)]


def solids(segments):
    """Name and triangles, as places in space, of each solid."""
    corners, ring = profile(segments), []
    width, end = width_of(segments), max(x for x, _ in corners)
    for a, b in zip(corners, corners[1:] + corners[:1]):
        low = [(a[0], 0.0, a[1]), (b[0], 0.0, b[1])]
        high = [(b[0], width, b[1]), (a[0], width, a[1])]
        name = "wall" if a[0] == b[0] == 0.0 else "tip" if a[0] == b[0] == end else "rest"
        ring += [(name, (low[0], high[0], low[1])), (name, (low[0], high[1], high[0]))]
    # A turn to the left in x and z faces -y
    for a, b, c in triangles(corners):
        ring.append(("rest", tuple((p[0], 0.0, p[1]) for p in (a, b, c))))
        ring.append(("rest", tuple((p[0], width, p[1]) for p in (a, c, b))))
    return {name: [facet for its, facet in ring if its == name] for name in ("wall", "tip", "rest")}


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else "bracket.stl"
    segments = int(sys.argv[2]) if len(sys.argv) > 2 else 24
    with open(path, "w", encoding="utf-8") as file:
        for name, facets in solids(segments).items():
            file.write(f"solid {name}\n")
            for facet in facets:
                file.write("facet normal 0 0 0\n outer loop\n")
                for place in facet:
                    file.write("  vertex " + " ".join(f"{x:.9g}" for x in place) + "\n")
                file.write(" endloop\nendfacet\n")
            file.write(f"endsolid {name}\n")


if __name__ == "__main__":
    main()
