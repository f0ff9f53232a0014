#!/usr/bin/env python3
"""Opens what `spectra fuse` writes with Open3D (Debian: python3-open3d) and compares it with what a reader of the test's own
finds in the PLY: tests/integration/other_programs.py SCENE.ply [SPECTRA]. Not a part of ctest, because Open3D brings fifty
packages. Exit status 0 when all is equal."""
import subprocess
import sys
import tempfile

import numpy
import open3d

METHOD = ["--method", "thermal_visible_blend"]


def read_ply(name):
    """Positions, colours and triangles of a binary PLY as Spectra writes it."""
    types = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4"}
    data = open(name, "rb").read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    counts = {"vertex": 0, "face": 0}
    columns = []
    for line in data[:end].decode().splitlines():
        words = line.split()
        if words[0] == "element":
            element = words[1]
            counts[element] = int(words[2])
        elif words[0] == "property" and element == "vertex":
            columns.append((words[2], types[words[1]]))
    vertices = numpy.frombuffer(data, numpy.dtype(columns), counts["vertex"], end)
    faces = numpy.frombuffer(data, numpy.dtype([("n", "u1"), ("v", "<i4", 3)]), counts["face"], end + vertices.nbytes)
    positions = numpy.stack([vertices[axis] for axis in "xyz"], 1).astype(float)
    colours = numpy.stack([vertices[channel] for channel in ("red", "green", "blue")], 1)
    return positions, colours, faces["v"]


def linear(colours):
    encoded = colours / 255
    return numpy.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def check(what, seen, wanted, tolerance=0.0):
    error = numpy.abs(numpy.asarray(seen) - wanted).max(initial=0) if len(seen) == len(wanted) else float("inf")
    print(f"{what}: {len(wanted)} values, off by at most {error:g}")
    if error > tolerance:
        sys.exit(f"{what} differ")


def main(scene, spectra="build/release/bin/spectra"):
    with tempfile.TemporaryDirectory() as folder:
        for ending in ("ply", "glb"):
            subprocess.run([spectra, "fuse", scene, f"{folder}/o.{ending}", *METHOD], check=True)
        positions, colours, triangles = read_ply(f"{folder}/o.ply")
        as_ply = open3d.io.read_triangle_mesh(f"{folder}/o.ply")
        check("PLY positions", as_ply.vertices, positions)
        check("PLY colours", as_ply.vertex_colors, colours / 255, 1e-9)
        check("PLY triangles", as_ply.triangles, triangles)
        as_glb = open3d.io.read_triangle_mesh(f"{folder}/o.glb")
        seen = numpy.asarray(as_glb.vertices)
        z_up = numpy.stack([positions[:, 0], positions[:, 2], -positions[:, 1]], 1)
        is_z_up = numpy.abs(seen - z_up).max() < numpy.abs(seen - positions).max()
        check(f"GLB positions ({'z' if is_z_up else 'y'} up)", seen, z_up if is_z_up else positions,
              1e-6 * numpy.abs(positions).max())
        check("GLB colours", as_glb.vertex_colors, linear(colours), 1 / 65535)
        check("GLB triangles", as_glb.triangles, triangles)


if __name__ == "__main__":
    main(*sys.argv[1:])
