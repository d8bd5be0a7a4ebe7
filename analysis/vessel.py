"""Make the mesh of the template `port`: a vessel with a port (manifold3d)."""

import argparse
from pathlib import Path

import numpy as np
import trimesh

OUTER, WALL = np.array([1100.0, 1000.0, 800.0]), 20.0
"""Size of the vessel and thickness of its walls; [mm]."""

FACE, PORT = 700.0, 110.0
"""Where the wall with the port stands on x, and the port's radius; [mm]."""

SIDES = 32
"""Of the polygon that is the port."""


def vessel() -> trimesh.Trimesh:
    """The walls, closed and turned outwards; [mm]."""
    middle = np.array([FACE + OUTER[0] / 2.0, 0.0, 0.0])
    outer = trimesh.creation.box(OUTER)
    inner = trimesh.creation.box(OUTER - 2.0 * WALL)
    for box in (outer, inner):
        box.apply_translation(middle)
    turn = trimesh.transformations.rotation_matrix(np.pi / 2.0, [0.0, 1.0, 0.0])
    port = trimesh.creation.cylinder(PORT, 6.0 * WALL, sections=SIDES, transform=turn)
    port.apply_translation([FACE, 0.0, 0.0])
    return trimesh.boolean.difference([outer, inner, port], engine="manifold")


def main() -> None:
    """Write the STL file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    folder = parser.parse_args().out
    mesh = vessel()
    mesh.export(folder / "vessel.stl")
    print(f"{len(mesh.faces)} triangles, closed: {mesh.is_watertight}")


if __name__ == "__main__":
    main()
