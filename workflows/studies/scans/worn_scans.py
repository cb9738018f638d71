"""Scans of a face before and after wear: what wore, and the wear coefficient of several tests."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from tribodyn.geometry import height_map_files
from tribodyn.geometry.height_map import HeightMap, centred, level, mirrored
from tribodyn.geometry.scan_alignment import SmoothMap, blocks
from tribodyn.geometry.worn_volume import WornFace, compare_scans
from tribodyn.output_file import write_text
from tribodyn.refusal import Refusal
from tribodyn.text_file import text_of
from tribodyn.workflows.pictures.figures import axes_of, length_unit
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, GREY, ORANGE, WEAR_MAP
from tribodyn.workflows.result.number_format import measured, named_lines
from tribodyn.workflows.scene.fields import Length, quantity
from tribodyn.workflows.scene.scene_file import AnyPath
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.scans.wear_coefficient import WearCoefficient, regression
from tribodyn.workflows.studies.study_result import StudyResult

COLUMNS = ("name", "work", "pristine", "worn", "second_pristine", "second_worn", "volume", "error")


@dataclass(frozen=True)
class WearTest:
    """A wear test: its faces, or a volume that was measured elsewhere.

    work : friction work up to its scans [J], nan where not known; volume, deviation : of both faces together [m3]
    faces : scanned, none, one or two;  total : depth of the faces together, laid on each other by their middles"""

    name: str
    work: float
    volume: float
    deviation: float
    faces: tuple[WornFace, ...] = ()
    total: HeightMap | None = None

    @property
    def is_doubtful(self) -> bool:
        """Whether scans of a face share no texture, so that they may lie on each other in the wrong place."""
        return not all(face.alignment.is_found for face in self.faces)


@dataclass(frozen=True, repr=False)
class WornScans(StudyResult):
    """Tests in the order of the file; coefficient : None where no test has a friction work."""

    tests: tuple[WearTest, ...]
    coefficient: WearCoefficient | None

    def columns(self) -> dict[str, list[Any]]:
        """A row for each face of each test, or for a test without scans."""
        rows: list[dict[str, Any]] = [
            {"test": test.name, "work_J": test.work, **row}
            for test in self.tests
            for row in [_face_row(face) for face in test.faces]
            or [{"volume_m3": test.volume, "volume_deviation_m3": test.deviation}]
        ]
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: [row.get(name, np.nan) for row in rows] for name in names}

    def record(self) -> dict[str, Any]:
        columns = self.columns()
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        return {
            "faces": [{name: None if value != value else value for name, value in row.items()} for row in rows],
            "volumes_m3": [test.volume for test in self.tests],
            "coefficient": None if self.coefficient is None else self.coefficient.record(),
            "doubtful": [test.name for test in self.tests if test.is_doubtful],
            "remarks": self._remarks(),
        }

    def _remarks(self) -> list[str]:
        return [*dict.fromkeys(remark for test in self.tests for face in test.faces for remark in face.remarks)]

    def _doubts(self) -> list[str]:
        return [
            f"{test.name}: no texture that both scans share was found, they may lie in the wrong place: "
            "its volume and depth, and what follows from them, are doubtful"
            for test in self.tests
            if test.is_doubtful
        ]

    def lines(self) -> list[str]:
        head = ("volume", "95 %", "worn area", "deepest", "noise", "shift", "turn", "missing")
        table = [f"{'test':18}" + "".join(f"{word:>16}" for word in head)]
        for test in self.tests:
            rows = [(test.name[:17], _cells(face)) for face in test.faces]
            if len(rows) != 1:
                label = f"{test.name[:11]}, total" if rows else test.name[:17]
                rows.append((label, (_volume(test.volume), f"+- {_volume(1.96 * test.deviation)}")))
            table += [f"{label:18}" + "".join(f"{cell:>16}" for cell in cells) for label, cells in rows]
        table += named_lines([("remark", remark) for remark in self._remarks()])
        table += [] if self.coefficient is None else self.coefficient.lines()
        return table + named_lines([("DOUBTFUL", doubt) for doubt in self._doubts()])

    def figures(self) -> dict[str, Figure]:
        """The pictures by name."""
        pictures = {} if self.coefficient is None else {"coefficient": self.coefficient.plot()}
        for test in self.tests:
            stem = "".join(c if c.isalnum() else "_" for c in test.name)
            for n, face in enumerate(test.faces, 1):
                title = f"{test.name}, face {n}{'' if face.alignment.is_found else ': DOUBTFUL, no common texture'}"
                pictures[f"worn_{stem}_{n}"] = _picture(face, title)
        return pictures

    def write(self, folder: Path) -> list[Path]:
        """Write worn.csv, a picture of every face, the line of the coefficient, gap.csv and wear.toml for a scene."""
        files = write_files(folder, {"worn": self.columns()}, self.figures)
        keys = [f"# DOUBTFUL: {doubt}" for doubt in self._doubts()]
        keys += [] if self.coefficient is None else [*self.coefficient.keys(), ""]
        scanned = [(test.name, test.total) for test in self.tests if test.total is not None]
        for name, total in scanned[-1:]:
            files.append(folder / "gap.csv")
            np.savetxt(files[-1], _opening(total), delimiter=",", fmt="%.9g")
            place = f"# opening by the worn depth of {name}, from the middle of the scan, z = 0"
            keys += [place, "[contacts.NAME]", 'gap_map = "gap.csv"']
        return [*files, write_text(folder / "wear.toml", "\n".join(keys) + "\n")]


def worn(
    pristine: AnyPath,
    worn: AnyPath | None = None,
    *,
    work: Annotated[float | None, quantity("J")] = None,
    mirror: Literal["x", "y"] | None = None,
    spacing: Annotated[Sequence[float] | None, quantity("m")] = None,
    lateral_unit: Length = 1.0,
    height_unit: Length = 1.0,
) -> WornScans:
    """Measure what wore between two scans of a face: volume, area, depth; and the wear coefficient of several tests.

    pristine : scan before wear: text, SDF, or what the package surfalize reads; or, without a worn scan, a file of
        tests .csv with the columns name, work, pristine, worn, second_pristine, second_worn, or name, work, volume,
        error
    worn : scan of the same face after wear
    work : friction work between the scans, such as "410 J"
    mirror : axis of the second face's scans that is reversed before its depth is added to that of the first
    spacing : steps along x and y of text files that hold a matrix of heights, such as "1um, 1um"
    lateral_unit : unit of lateral coordinates in text files, such as 1um
    height_unit : unit of heights in text files, such as 1um
    Raises  Refusal: scans that are not of one face, a file of tests that cannot be one"""
    if spacing is not None and len(spacing) != 2:
        raise Refusal('--spacing: give two steps, along x and y, such as "1um, 1um"')
    steps = None if spacing is None else (spacing[0], spacing[1])

    def scan(path: Path) -> HeightMap:
        return height_map_files.read(path, spacing=steps, lateral_unit=lateral_unit, height_unit=height_unit)

    if worn is None:
        tests = tuple(_test(row, Path(pristine), scan, mirror) for row in _rows(Path(pristine)))
    else:
        scans = {"pristine": Path(pristine), "worn": Path(worn)}
        tests = (_scanned("scan", np.nan if work is None else work, scans, scan, mirror),)
    known = [test for test in tests if test.work > 0]
    numbers = (np.array([getattr(t, name) for t in known]) for name in ("work", "volume", "deviation"))
    return WornScans(tests, regression(*numbers) if known else None)


def _opening(depth: HeightMap) -> np.ndarray:
    """Rows x, y, z, opening (k, 4) [m] for `gap_map` of a contact, means over some points."""
    x, y = np.meshgrid(depth.x, depth.y, indexing="ij")
    size = max(max(depth.z.shape) // 60, 1)
    return np.column_stack([blocks(v, size).mean(axis=-1).ravel() for v in (x, y, 0 * x, depth.z)])


def _rows(path: Path) -> list[Mapping[str, str]]:
    """Rows of a file of tests."""
    if path.suffix.lower() != ".csv" or not path.is_file():
        raise Refusal(f"{path}: give a worn scan too, or a file .csv of tests")
    lines = [line for line in text_of(path).splitlines() if line.strip() and not line.startswith("#")]
    rows = [{(k or "").strip(): (v or "").strip() for k, v in row.items()} for row in csv.DictReader(lines, restval="")]
    if not rows or set(rows[0]) - set(COLUMNS) or not {"volume", "worn"} & set(rows[0]):
        raise Refusal(f"{path.name}: expected tests below names of columns: worn or volume, of {', '.join(COLUMNS)}")
    return [{"name": f"test {number}", **{k: v for k, v in row.items() if v}} for number, row in enumerate(rows, 1)]


def _test(row: Mapping[str, str], path: Path, scan: Any, mirror: str | None) -> WearTest:
    try:
        work, error = to_si(row["work"], "J") if "work" in row else np.nan, to_si(row.get("error", "0 m3"), "m3")
        if "volume" in row:
            return WearTest(row["name"], work, to_si(row["volume"], "m3"), error)
        scans = {name: path.parent / row[name] for name in COLUMNS[2:6] if name in row}
        return _scanned(row["name"], work, scans, scan, mirror)
    except Refusal as trouble:
        raise Refusal(f"{path.name}, {row['name']}: {trouble}") from None


def _scanned(name: str, work: float, scans: Mapping[str, Path], scan: Any, mirror: str | None) -> WearTest:
    """The test of two or four scans."""
    pairs = [(f"{of}pristine", f"{of}worn") for of in ("", "second_")]
    given = [pair for pair in pairs if set(pair) & set(scans)]
    if not given or any(set(pair) - set(scans) for pair in given) or given[0] != pairs[0]:
        raise Refusal("give pristine and worn of the first face, and both or none of the second")
    faces = tuple(compare_scans(*(scan(scans[key]) for key in pair)) for pair in given)
    total = faces[0].map
    if len(faces) == 2:
        other = faces[1].map if mirror is None else mirrored(faces[1].map, mirror)
        x, y = np.meshgrid(total.x, total.y, indexing="ij")
        total = replace(total, z=total.z + np.nan_to_num(SmoothMap(other).at(x, y)), name="depth of both faces")
    volume, deviation = sum(f.volume for f in faces), float(np.hypot.reduce([f.volume_deviation for f in faces]))
    return WearTest(name, work, volume, deviation, faces, total)


def _face_row(face: WornFace) -> dict[str, Any]:
    return {
        "scan": face.pair.worn.name, "volume_m3": face.volume, "volume_deviation_m3": face.volume_deviation,
        "area_m2": face.area, "deepest_m": face.deepest, "noise_m": face.noise, "texture": face.alignment.texture,
        "doubtful": int(not face.alignment.is_found),
        **dict(zip(("shift_x_m", "shift_y_m"), face.alignment.shift, strict=True)),
        "turn_deg": float(np.degrees(face.alignment.turn)), "missing": face.missing,
        **{f"deviation_by_{cause.replace(' ', '_')}_m3": value for cause, value in face.deviations.items()},
    }  # fmt: skip


def _cells(face: WornFace) -> tuple[str, ...]:
    shift, turn = float(np.hypot(*face.alignment.shift)), f"{np.degrees(face.alignment.turn):.3f} deg"
    place = (measured(shift, "m"), turn) if face.alignment.is_found else ("DOUBTFUL", "-")
    return (
        _volume(face.volume), f"+- {_volume(1.96 * face.volume_deviation)}", measured(face.area, "m2"),
        measured(face.deepest, "m"), measured(face.noise, "m"), *place, f"{100 * face.missing:.2g} %",
    )  # fmt: skip


def _volume(value: float) -> str:
    """In a unit that fits scans."""
    return f"{1e9 * value:.4g} mm³" if abs(value) >= 1e-11 else f"{1e18 * value:.4g} µm³"


def _picture(face: WornFace, title: str) -> Figure:
    """Both scans levelled, the depth with the border of what wore, and a profile through the deepest place."""
    x, y = (1e3 * values for values in face.pair.grid)
    depth = face.map
    unit, scale = length_unit(face.deepest)
    row = int(np.argmax(np.where(face.region, depth.z, -np.inf).max(axis=1)))
    scans = [centred(level(scan)) for scan in (face.pair.pristine, face.pair.worn)]
    low, high = 1e6 * np.nanpercentile(scans[1].z, (0.5, 99.5))
    with axes_of(9.2, 7.4, rows=2, columns=2, share=False) as (figure, axes):
        for pane, scan, name in zip(axes[0], scans, ("pristine", "worn, as scanned"), strict=True):
            _map(pane, 1e3 * scan.x, 1e3 * scan.y, 1e6 * scan.z, "height / µm", (low, high))
            pane.set_title(name)
        _map(axes[1, 0], x[:, 0], y[0], scale * depth.z, f"depth / {unit}", (0.0, scale * max(face.deepest, 1e-12)))
        if face.worn.any():
            axes[1, 0].contour(x, y, face.worn, [0.5], colors=ORANGE, linewidths=0.8)
        axes[1, 0].axvline(x[row, 0], color=GREY, lw=0.8, ls="--")
        axes[1, 0].set_title("depth, border of what wore")
        axes[1, 1].plot(y[row], -scale * face.depth[row], color=GREY, lw=0.6, label="points")
        axes[1, 1].plot(y[row], -scale * depth.z[row], color=BLUE, label="mean of neighbours")
        axes[1, 1].set(xlabel="y / mm", ylabel=f"- depth / {unit}", title=f"profile at x = {x[row, 0]:.3g} mm")
        axes[1, 1].legend()
        figure.suptitle(title, x=0.01, ha="left")
    return figure


def _map(axes: Any, x: np.ndarray, y: np.ndarray, values: np.ndarray, label: str, limits: tuple[float, float]) -> None:
    step = max(max(values.shape) // 300, 1)  # more points than the picture shows would only make it large
    x, y, values = x[::step], y[::step], values[::step, ::step].T
    shown = axes.pcolormesh(x, y, values, cmap=WEAR_MAP, vmin=limits[0], vmax=limits[1], rasterized=True)
    axes.set(aspect="equal", xlabel="x / mm", ylabel="y / mm")
    axes.grid(visible=False)
    axes.figure.colorbar(shown, ax=axes, label=label, shrink=0.85)
