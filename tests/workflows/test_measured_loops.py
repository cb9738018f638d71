"""Measured hysteresis loops: planted ones within their intervals, from every format, with what a rig engineer gives."""

import tomllib

import h5py
import numpy as np
import pytest
import pyuff
from scipy.io import savemat

import tribodyn as td
from tests.helpers.planted_loops import LAWS, evaluation
from tribodyn.refusal import Refusal
from tribodyn.workflows.export.result_tables import DataKind, Function, function
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.studies.many.distributions import Distribution
from tribodyn.workflows.studies.measured.channels import read_channels


@pytest.mark.parametrize("law", LAWS)
def test_planted_numbers_lie_within_their_intervals(law, tmp_path):
    truth, loops = evaluation(law, 3, tmp_path)
    run = loops.governing
    outside = {
        n: (v, run.intervals[n]) for n, v in truth.items() if abs(run.intervals[n].value - v) > run.intervals[n].half
    }
    assert not outside
    assert run.rules["energy_travel"] < run.rules["plateau"] < run.rules["largest"]  # elastic share; noise and peaks
    written = {path.name: path for path in loops.write(tmp_path)}
    assert set(written) == {"loops.csv", "rules.csv", "cycles.csv", "loops.png", "contact.toml", "vary.toml"}
    contact = tomllib.loads(written["contact.toml"].read_text())["contact"]
    assert abs(to_si(contact["tangential_stiffness"], "N/m") / run.numbers["reversal"] - 1) < 1e-4
    assert Distribution(**tomllib.loads(written["vary.toml"].read_text())["vary"]["contact"]["friction"])


def test_channels_of_every_format_are_combined(tmp_path):
    columns = {
        "time [s]": np.linspace(0, 1, 9),
        "F1 [kN]": np.arange(9.0),
        "F2 [N]": np.ones(9),
        "U [V]": np.full(9, 2.0),
    }
    (tmp_path / "a.csv").write_text(
        "# normal = F2\n"
        + ",".join(columns)
        + "\n"
        + "\n".join(",".join(map(str, r)) for r in zip(*columns.values(), strict=True))
    )
    savemat(tmp_path / "a.mat", {"F1_kN": columns["F1 [kN]"], "F2_N": columns["F2 [N]"], "U": columns["U [V]"]})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in columns.items():
            file[name.split()[0]] = values
            file[name.split()[0]].attrs["unit"] = name.split("[")[1][:-1]
    for name, values in [*columns.items()][1:]:
        channel, unit = name[:-1].split(" [")
        entry = function(
            Function.TIME, channel, "time", DataKind.TIME, "s", columns["time [s]"], DataKind.FORCE, unit, values, 1
        )
        pyuff.UFF(str(tmp_path / "a.uff")).write_sets(entry, "add")
    for ending in ("csv", "mat", "h5", "uff"):
        _, (run,) = read_channels(tmp_path / f"a.{ending}", ("normal",))
        force = run.combined("cos(60 deg)*F1 - 2*F2 + 3 N*U - 1e-3 kN", "N")
        np.testing.assert_allclose(force, 500 * np.arange(9.0) - 2 + 6 - 1, rtol=1e-6)
    with pytest.raises(Refusal, match="U in F1 - U is not in N or alike: name the channel with its unit"):
        run.combined("F1 - U", "N")
    with pytest.raises(Refusal, match="whole cycles at"):
        td.studies.loops(tmp_path / "a.csv", displacement="1 mm*U", tangential="F1", normal="F2")
