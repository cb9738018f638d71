"""One mesh of twenty-node bricks written in every format, by writers that share nothing with the readers."""

from pathlib import Path

import meshio
import numpy as np

from tribodyn.geometry.gmsh_session import session


def bricks(folder: Path) -> meshio.Mesh:
    """A slightly bent bar of 4 x 1 x 2 bricks, as meshio sees it."""
    path = folder / "bricks.msh"
    with session() as gmsh:
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
        gmsh.model.occ.addBox(0, 0, 0, 0.2, 0.03, 0.05)
        gmsh.model.occ.synchronize()
        for _, tag in gmsh.model.getEntities(1):
            a, b = np.reshape(gmsh.model.getBoundingBox(1, tag), (2, 3))
            count = dict(zip((0, 1, 2), (5, 2, 3), strict=True))[int(np.argmax(b - a))]
            gmsh.model.mesh.setTransfiniteCurve(tag, count)
        for _, tag in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(tag)
            gmsh.model.mesh.setRecombine(2, tag)
        gmsh.model.mesh.setTransfiniteVolume(1)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.model.addPhysicalGroup(3, [1], name="bar")
        gmsh.write(str(path))
    file = meshio.gmsh.read(path)
    points = file.points.copy()
    points[:, 2] += 0.5 * points[:, 0] ** 2
    return meshio.Mesh(points, [("hexahedron20", file.cells_dict["hexahedron20"])])


def root(mesh: meshio.Mesh) -> np.ndarray:
    """Numbers from 1 of the nodes at x = 0."""
    return np.flatnonzero(np.abs(mesh.points[:, 0]) < 1e-12) + 1


def write(mesh: meshio.Mesh, path: Path, kind: str) -> Path:
    """Write the mesh with the node set ROOT where the format has sets; kind tells the two versions of MSH apart."""
    nodes, points, fixed = mesh.cells_dict["hexahedron20"] + 1, mesh.points, root(mesh).tolist()
    if path.suffix == ".msh":
        with session() as gmsh:
            gmsh.option.setNumber("Mesh.MshFileVersion", float(kind))
            gmsh.option.setNumber("Mesh.Binary", float(kind) > 3)
            gmsh.model.addDiscreteEntity(3, 1)
            gmsh.model.mesh.addNodes(3, 1, np.arange(1, len(points) + 1), points.ravel())
            to_gmsh = [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14]
            gmsh.model.mesh.addElementsByType(1, 17, [], nodes[:, to_gmsh].ravel())
            gmsh.option.setNumber("Mesh.SaveAll", 1)
            gmsh.write(str(path))
        return path
    if path.suffix in (".vtk", ".vtu", ".med"):
        flags = np.isin(np.arange(1, len(points) + 1), fixed).astype(np.int32)
        data = {} if path.suffix == ".med" else {"ROOT": flags}
        meshio.write(path, meshio.Mesh(points, mesh.cells, point_data=data))
        return path
    lines: list[str] = []
    if path.suffix == ".inp":
        lines.append("*NODE")
        lines += [f"{i}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(points.tolist(), 1)]
        lines.append("*ELEMENT, TYPE=C3D20R, ELSET=BAR")
        for i, e in enumerate(nodes.tolist(), 1):
            lines += [f"{i}, " + ", ".join(map(str, e[:10])) + ",", ", ".join(map(str, e[10:]))]
        lines += ["*NSET, NSET=ROOT", *(f"{label}," for label in fixed)]
    elif path.suffix == ".bdf":
        lines += ["SOL 103", "CEND", "SET 7 = " + ",\n".join(map(str, fixed)), "BEGIN BULK"]
        lines += [
            f"GRID*   {i:16d}{'':16}{x:16.9e}{y:16.9e}*\n*       {z:16.9e}" for i, (x, y, z) in enumerate(points, 1)
        ]
        for i, e in enumerate(nodes.tolist(), 1):
            e = [*e[:12], *e[16:], *e[12:16]]
            lines.append(f"CHEXA   {i:8d}{3:8d}" + "".join(f"{n:8d}" for n in e[:6]))
            lines.append("+       " + "".join(f"{n:8d}" for n in e[6:14]))
            lines.append("+       " + "".join(f"{n:8d}" for n in e[14:]))
        lines += ["PSOLID,3,1", "MAT1,1,210.+9,,.3,7860.", "ENDDATA"]
    else:
        lines += ["/PREP7", "ET,1,186", f"NBLOCK,6,SOLID,{len(points)},{len(points)}", "(3i9,6e21.13e3)"]
        lines += [f"{i:9d}{0:9d}{0:9d}{x:21.13E}{y:21.13E}{z:21.13E}" for i, (x, y, z) in enumerate(points, 1)]
        lines += ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{len(nodes)},{len(nodes)}", "(19i9)"]
        for i, e in enumerate(nodes.tolist(), 1):
            head = [1, 1, 1, 1, 0, 0, 0, 0, 20, 0, i]
            lines += ["".join(f"{n:9d}" for n in [*head, *e[:8]]), "".join(f"{n:9d}" for n in e[8:])]
        lines += ["       -1", f"CMBLOCK,ROOT,NODE,{len(fixed):8d}", "(8i10)"]
        lines += ["".join(f"{n:10d}" for n in fixed[k : k + 8]) for k in range(0, len(fixed), 8)]
        lines += ["MPDATA,R5.0, 1,EX  ,  1, 1,  2.1E+11,", "FINISH"]
    path.write_text("\n".join(lines) + "\n")
    return path
