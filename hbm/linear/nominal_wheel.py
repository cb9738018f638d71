"""Port compliances of a wheel of equal sectors, index by index."""

from collections import OrderedDict
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.expansion import Expansion
from tribodyn.reduction.wave_model import WaveModel

ROOM = 2e8  # bytes of matrices of cached compliances


class NominalWheel:
    """Port compliances of a wheel of sectors alike, contacts stuck and closed; shared by all that deviate from it.

    model : a travelling wave whose outputs hold the rows `ports`; springs : (n_pair, n_component) of one sector [N/m]
    excitation : of sector 0; a wave of the model's engine order brings it to the others
    omega_max : largest excitation frequency to come [rad/s]"""

    def __init__(
        self, model: WaveModel, springs: np.ndarray, basis: HarmonicBasis, excitation: Excitation, omega_max: float,
        ports: tuple[str, ...],
    ):  # fmt: skip
        self.n_sectors = N = model.n_sectors
        self.k = np.asarray(springs, float).ravel()
        system, _ = model.at_index(0)
        excitation.check(basis, system.loads)
        self.load_names = names = tuple(sorted({name for _, name in excitation.loads}))
        self.outputs = tuple(name for name in system.outputs if name not in ports)
        counts = np.cumsum([0, len(self.k), len(names), len(self.outputs), len(ports)])
        self.contacts, self.loads, self.observed, self.ports = (slice(*pair) for pair in pairwise(counts))
        self.n_port = int(counts[-1])
        self._of_index: list[Expansion] = []
        for index in range(N // 2 + 1):
            system, B = model.at_index(index)
            rows = [np.conj(system.loads[name]) for name in names]
            rows += [system.outputs[name] for name in (*self.outputs, *ports)]
            together = np.concatenate([np.asarray(B), np.array(rows).reshape(len(rows), -1)])
            s_max = basis.harmonics[-1] * omega_max
            self._of_index.append(Expansion(system, np.asarray(B), self.k, together, s_max))
        self._mirrored = [None if expansion.hermitian else expansion.mirrored() for expansion in self._of_index]
        self.error = max(expansion.error for expansion in self._of_index)
        self.force = np.zeros((len(basis.harmonics), N, len(names)), complex)
        order = model.engine_order
        for (h, name), value in excitation.loads.items():
            if h in basis.harmonics:
                turned = value * np.exp(-2j * np.pi * (h * order * np.arange(N) % N) / N)
                self.force[basis.harmonics.index(h), :, names.index(name)] = turned
        self._cache: OrderedDict[complex, np.ndarray] = OrderedDict()

    def at(self, s: complex) -> np.ndarray:
        """(N, n_port, n_port) compliance of every wave at s = i h w, index by index."""
        if s in self._cache:
            self._cache.move_to_end(s)
            return self._cache[s]
        compliance = self._of_every_index(lambda expansion: expansion.at(s).matrix())
        self._cache[s] = compliance
        while len(self._cache) > 1 and len(self._cache) * compliance.nbytes > ROOM:
            self._cache.popitem(last=False)
        return compliance

    def slope(self, s: complex) -> np.ndarray:
        """d (at) / d s."""
        return self._of_every_index(lambda expansion: expansion.at(s).slope(np.eye(self.n_port), 1.0))

    def _of_every_index(self, make: Callable[[Expansion], np.ndarray]) -> np.ndarray:
        N = self.n_sectors
        matrices = np.empty((N, self.n_port, self.n_port), complex)
        for index, (expansion, mirror) in enumerate(zip(self._of_index, self._mirrored, strict=True)):
            matrices[index] = make(expansion)
            if 0 < 2 * index < N:  # without what turns, a wave the other way is reciprocal to this one
                matrices[N - index] = matrices[index].T if mirror is None else make(mirror)
        return matrices
