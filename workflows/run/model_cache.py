"""Cache of parts, reduced models and heights of faces on disk, under a hash of all that they are made of.

An entry is a pickle behind a signature of its name and content by the user's own key, which lies outside the folder:
what somebody else put there, and what is damaged, is not loaded but built again. It is written under another name and
renamed when it is complete; a run waits for another one that builds the same entry. The entries unused for longest are
removed where all together exceed `ROOM`."""

import errno
import hashlib
import hmac
import os
import pickle
import platform
import re
import secrets
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from filelock import FileLock

from tribodyn.fem.part import Part
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.threads import limited, usable
from tribodyn.reduction.model import ReducedModel
from tribodyn.version import package_version
from tribodyn.workflows.run import joints, part_reduction
from tribodyn.workflows.scene.fields import PART
from tribodyn.workflows.scene.file_digests import code, digests, files_named
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.scene_values import values_through
from tribodyn.workflows.scene.schema import MeshScene

FOLDER = "TRIBODYN_CACHE"  # variable of the environment: another folder, or "off"
ROOM = 4e9  # bytes of all entries: ten of the Brake-Reuss beam, the largest scene that comes along
PACKAGES = ("numpy", "scipy", "numba", "scikit-fem", "gmsh", "meshio", "pypardiso", "mkl", "pymetis")
CODE = code()  # of what this process has loaded: sources may change before it makes anything
INCLUDES = re.compile(rb"(?:^|[\r\n])[\xef\xbb\xbf\xfe\xff \t]*\*?[ \t]*(include|merge)\b|shapefromfile", re.IGNORECASE)

T = TypeVar("T")
_last: ContextVar[dict[str, Any] | None] = ContextVar("tribodyn_last", default=None)


@contextmanager
def memory_cache() -> Iterator[None]:
    """Keep the last part, reduced model and balance in memory too, for a study of scenes that differ little."""
    before = _last.set({})
    try:
        yield
    finally:
        _last.reset(before)


def cached_balance(make: Callable[[HarmonicBalance | None], HarmonicBalance]) -> HarmonicBalance:
    """Build a balance. Reuse the cached compliance of the previous one if it matches."""
    last = _last.get()
    if last is None:
        return make(None)
    last["balance"] = balance = make(last.get("balance"))
    return balance


def cached_part(file: SceneFile, make: Callable[[], Part]) -> Part:
    """The part of a scene, without the gap of measured faces: read from the cache, else built and cached."""
    scene = file.mesh_scene
    return _cached(file, "part", (values_through(scene, PART), _kinds_of_loads(scene)), make)


def cached_reduction(file: SceneFile, part: Part, make: Callable[[], ReducedModel]) -> ReducedModel:
    """The reduced model of a part, undamped, with nothing prescribed: read from the cache, else built and cached.

    It does not depend on the gaps, which are those of the part."""
    scene, interface, springs = file.mesh_scene, part.interface, b""
    speeds = scene.operating_range if scene.wheel and scene.wheel.along_speed else ()
    if scene.wheel or part_reduction.without_masters(scene, interface.B.shape[0], len(part.held_rows) > 0):
        springs = joints.contact_stiffness(scene, joints.unreduced(part)).tobytes()
    values = values_through(scene, scene.reduced_through)
    model = _cached(file, "reduction", (values, _kinds_of_loads(scene), springs, speeds), make)
    return replace(model, interface=replace(model.interface, gap=interface.gap))


def _kinds_of_loads(scene: MeshScene) -> list[str]:
    """The kind of every load, which the part has per unit of its amplitude."""
    return [load.kind for load in (*scene.loads.static.values(), *scene.loads.harmonic.values())]


def cached_heights(file: SceneFile, nodes: np.ndarray, make: Callable[[], T]) -> T:
    """Heights of measured faces at contact nodes, before the mating height, from the cache or built."""
    surfaces = file.mesh_scene.model_dump(include={"surfaces"}, exclude={"surfaces": {"mating_height"}})
    return _cached(file, "heights", (surfaces, nodes.tobytes()), make)


def cache_folder() -> Path | None:
    """The folder of the entries; None where the cache is off."""
    setting = os.environ.get(FOLDER)
    if setting is not None:
        return None if setting in ("", "off") else Path(setting)
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tribodyn"
    except RuntimeError:  # a user without a home
        return None


def _key(file: SceneFile, early: dict[str, Any], *others_of_key: object) -> str:
    """Hash of the tables, of the files that they name, of the program and of its packages; empty where it is not known.

    What a file of Python code reads, or one that includes others, is not known; the program's own code is in CODE."""
    named = files_named(early, file.folder)
    if not file.is_shipped and any(_reads_others(path, path.stat().st_mtime_ns) for path in named.values()):
        return ""
    versions = (platform.python_version(), platform.machine(), *map(package_version, PACKAGES))
    content = (early, digests(early, file.folder), usable(file.scene.solver.threads), CODE, versions, others_of_key)
    return hashlib.sha256(repr(content).encode()).hexdigest()


@cache
def _reads_others(path: Path, changed: int) -> bool:
    return path.suffix == ".py" or INCLUDES.search(path.read_bytes().replace(b"\0", b"")) is not None


def _cached(file: SceneFile, kind: str, ingredients: tuple[Any, ...], make: Callable[[], T]) -> T:
    """ingredients : what it is made of, its tables first."""
    room, last = cache_folder(), _last.get()
    if last is not None and kind in last and last[kind][0] == ingredients:
        model: T = last[kind][1]
        return model
    with limited(file.scene.solver.threads):  # who makes it: another count rounds differently
        model = make() if room is None else _cached_on_disk(room, _key(file, *ingredients), make)
    if last is not None:
        last[kind] = ingredients, model
    return model


def _cached_on_disk(room: Path, key: str, make: Callable[[], T]) -> T:
    if not key:
        return make()
    path, lock = room / f"{key}.pickle", FileLock(room / f"{key[:2]}.lock")
    try:
        room.mkdir(mode=0o700, parents=True, exist_ok=True)
        _require_private(room, stat.S_IWOTH)
        config = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
        signing_key = _signing_key(config / "tribodyn" / "cache.key")
        lock.acquire()  # released by the system where its holder is killed
    except (OSError, NotImplementedError, RuntimeError):  # or a disk that cannot lock, a user without a home
        return make()
    try:
        model: T | None = _read(path, signing_key)
        if model is None:
            model = make()
            _write(path, model, signing_key)
        return model
    finally:
        lock.release()


@cache
def _signing_key(path: Path) -> bytes:
    """The user's own key, made where there is none. Raises OSError: others can open it, or it cannot be made"""
    if not path.exists():
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        fresh = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
        fresh.touch(0o600)
        fresh.write_bytes(secrets.token_bytes(32))
        with suppress(FileExistsError):  # another run was first
            os.link(fresh, path)
        fresh.unlink()
    _require_private(path, stat.S_IRWXG | stat.S_IRWXO)
    return path.read_bytes()


def _require_private(path: Path, forbidden: int) -> None:
    """Raise OSError where a file or folder is another user's, or has bits of its mode that are forbidden."""
    if not hasattr(os, "getuid"):  # Windows has no such bits; the folder of a profile is its user's own
        return
    status = path.stat()
    if status.st_uid != os.getuid() or status.st_mode & forbidden:
        raise PermissionError(errno.EPERM, "others can change it", str(path))


def _signature(stream: BinaryIO, path: Path, signing_key: bytes) -> bytes:
    """Signature (RFC 2104) of the name of an entry and of what follows in its file."""
    started = partial(hmac.new, signing_key, path.name.encode(), "sha256")
    return hashlib.file_digest(stream, started).digest()  # type: ignore[arg-type]


def _read(path: Path, signing_key: bytes) -> Any:
    """What an entry holds, None where there is none, it is not the user's own, damaged, or needs a missing package."""
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream:
            signature = stream.read(hashlib.sha256().digest_size)
            start = stream.tell()
            if not hmac.compare_digest(_signature(stream, path, signing_key), signature):
                return None
            stream.seek(start)
            os.utime(path)
            return pickle.load(stream)
    except (OSError, ModuleNotFoundError):
        return None


def _write(path: Path, model: object, signing_key: bytes) -> None:
    """Keep an entry, and let the longest unused go; nothing where it is too large or the disk is full."""
    fresh = path.with_suffix(".new")
    try:
        with fresh.open("wb+") as stream:
            start = stream.write(bytes(hashlib.sha256().digest_size))
            pickle.dump(model, stream, pickle.HIGHEST_PROTOCOL)
            if stream.tell() > ROOM / 4:
                raise OSError(errno.EFBIG, "too large to be kept")
            stream.seek(start)
            signature = _signature(stream, path, signing_key)
            stream.seek(0)
            stream.write(signature)
        os.replace(fresh, path)
        entries = [(entry.stat().st_mtime, entry.stat().st_size, entry) for entry in path.parent.glob("*.pickle")]
        total = sum(size for _, size, _ in entries)
        for _, size, entry in sorted(entries):
            if total > ROOM:
                entry.unlink(missing_ok=True)
                total -= size
    except OSError:
        fresh.unlink(missing_ok=True)
