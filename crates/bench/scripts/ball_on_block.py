"""Writes block.obj, a closed mesh of 320 triangles with a top of pyramids, and ball_on_block.toml beside it: a ball of 105
thousand tetrahedra falls on it. `proxel simulate ball_on_block.toml --out DIR`; docs/simulate.md, "Size".

    python ball_on_block.py FOLDER
"""

import pathlib
import sys

CELLS, WIDTH, DEPTH, HEIGHT = 8, 3.2, 0.5, 0.15

SCENE = """title = "A ball falls on a block with a rugged top"

[time]
dt = 0.03333333333333333
frames = 100

[solver]
method = "auto"
tol = 1e-6

[[body]]
name = "ball"
generate = { ball = { radius = 0.8, cell = 0.05 } }
material = { energy = "neo-hookean", young = 1e6, poisson = 0.4 }
density = 1000
translate = [0.05, 1.2, 0.03]

[[obstacle]]
name = "block"
shape = { mesh = { file = "block.obj" } }
"""


def height(i, j):
    """Of the top above vertex (i, j): every second one inside is the top of a pyramid."""
    inside = 0 < i < CELLS and 0 < j < CELLS
    return HEIGHT if inside and (i + j) % 2 == 0 else 0.0


def block():
    """The lines of the mesh, outward faces."""
    n, at = CELLS + 1, [WIDTH * (k / CELLS - 0.5) for k in range(CELLS + 1)]
    vertices = [(at[i], height(i, j), at[j]) for i in range(n) for j in range(n)]
    vertices += [(at[i], -DEPTH, at[j]) for i in range(n) for j in range(n)]

    def top(i, j):
        return i * n + j + 1

    def bottom(i, j):
        return n * n + top(i, j)

    faces = []
    for i in range(CELLS):
        for j in range(CELLS):
            a, b, c, d = top(i, j), top(i + 1, j), top(i + 1, j + 1), top(i, j + 1)
            # The diagonal through the top of the pyramid.
            if height(i, j) > 0 or height(i + 1, j + 1) > 0:
                faces += [(a, d, c), (a, c, b)]
            else:
                faces += [(a, d, b), (b, d, c)]
            a, b, c, d = bottom(i, j), bottom(i + 1, j), bottom(i + 1, j + 1), bottom(i, j + 1)
            faces += [(a, b, c), (a, c, d)]
    for k in range(CELLS):
        sides = [
            (top(k, 0), top(k + 1, 0), bottom(k + 1, 0), bottom(k, 0)),
            (top(k + 1, CELLS), top(k, CELLS), bottom(k, CELLS), bottom(k + 1, CELLS)),
            (top(0, k + 1), top(0, k), bottom(0, k), bottom(0, k + 1)),
            (top(CELLS, k), top(CELLS, k + 1), bottom(CELLS, k + 1), bottom(CELLS, k)),
        ]
        faces += [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))]
    return [f"v {x:g} {y:g} {z:g}" for x, y, z in vertices] + ["f " + " ".join(map(str, face)) for face in faces]


if __name__ == "__main__":
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "block.obj").write_text("\n".join(block()) + "\n")
    (folder / "ball_on_block.toml").write_text(SCENE)
