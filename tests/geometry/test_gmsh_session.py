"""The door to Gmsh: what it writes is whole, or is told."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from tribodyn.geometry.gmsh_session import save, session


@pytest.mark.faults
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_mesh_that_the_disk_does_not_take_whole_is_told(tmp_path: Path, share: float) -> None:
    """Gmsh says nothing where a disk is full; here its file is cut."""
    path = tmp_path / "box.msh"
    with session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1])
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
        gmsh.model.mesh.generate(3)

        def write(name: str) -> None:
            gmsh.write(name)
            os.truncate(name, int(share * Path(name).stat().st_size))

        simple_namespace = SimpleNamespace(option=gmsh.option, write=write)
        if share == 1.0:
            save(simple_namespace, path)
        else:
            with pytest.raises(OSError, match=r"box\.msh': is the disk full"):
                save(simple_namespace, path)


@pytest.mark.faults
def test_a_session_that_was_cut_off_before_it_could_end_is_ended_first(capfd):
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    with session() as repeated:
        assert repeated.model.getEntities() == []
    assert "already" not in (text := "".join(capfd.readouterr())).replace("aleady", "already"), text
    assert not gmsh.isInitialized()
