"""A scan named in a scene's [surfaces] gives the table of asperities of the law `rough` by itself."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tribodyn.geometry import height_map_files
from tribodyn.geometry.asperities import identify
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError

SPACING, CUTOFF, SHORTEST = 2e-6, 80e-6, 10e-6
FACES = ["surfaces.first=scan.txt", "surfaces.spacing=[2e-6, 2e-6]", "surfaces.cutoff=80 um", "surfaces.shortest=10 um"]
NO_TABLE = "contacts.lap.table="


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """The rough beam with the scan of a face beside it."""
    heights = gaussian_filter(np.random.default_rng(3).standard_normal((120, 100)), 1.5)
    np.savetxt(tmp_path / "scan.txt", 1e-6 * heights)
    for name in ("brb_flat.toml", "asperities.csv"):
        shipped = scene_file.find("brb_flat").parent / name
        (tmp_path / name).write_text(shipped.read_text(encoding="utf-8"), encoding="utf-8")
    return tmp_path / "brb_flat.toml"


def test_the_scan_gives_radius_and_table(scene: Path):
    read = scene_file.read(str(scene), [NO_TABLE, "contacts.lap.radius=", *FACES]).scene.joints["lap"]
    scan = height_map_files.read(scene.parent / "scan.txt", spacing=(SPACING, SPACING))
    computed = identify(scan, cutoff=CUTOFF, shortest=SHORTEST)
    assert read.numbers["radius"] == pytest.approx(computed.radius, rel=1e-12)
    np.testing.assert_allclose(np.array(read.table), computed.table(), rtol=1e-12)
    inputs = scene_file.read(str(scene), [NO_TABLE, *FACES]).scene.joints["lap"]
    assert inputs.numbers["radius"] == pytest.approx(1.36493e-3)  # what the file says is kept
    assert inputs.table == read.table
    base = scene_file.read(str(scene), FACES).scene.joints["lap"]
    assert base.table == scene_file.read("brb_flat").scene.joints["lap"].table


@pytest.mark.parametrize(("changes", "said"), [
    ([NO_TABLE], "contact.table is missing"),
    ([NO_TABLE, *FACES, "surfaces.first=none.txt"], "no asperities for the law 'rough'"),
    ([NO_TABLE, *FACES, "surfaces.shortest=1 mm"], "no asperities for the law 'rough'"),
    ([NO_TABLE, *FACES, "surfaces.cutoff=0 um"], "surfaces.cutoff"),
])  # fmt: skip
def test_what_cannot_be_is_told(scene: Path, changes: list[str], said: str):
    with pytest.raises(SceneError, match=said):
        scene_file.read(str(scene), changes)
