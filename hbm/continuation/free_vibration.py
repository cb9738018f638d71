"""Free vibration with friction: the balance without a force, in frequency and damping, bordered by a reference mode.

    M q'' + (C - 2 zeta w M) q' + K q + B^T f_c(x) = F_0,    phi^H M q_1 = a

The linear side is solved directly in all modes of the stuck structure, since the added term changes it at every point;
the border, the reference mode phi, keeps it regular in resonance, and what it needs to hold phi at the amplitude a is
the residual that w and zeta bring to zero. A point is described by scaled coordinates: static displacement, vibration
over amplitude, the logarithm of w, zeta, and the logarithm of a.
Source  extended periodic motion concept: Krack 2015, Computers & Structures 154; the bordered elimination is ours"""

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import SEPARATES, ContactCycle
from tribodyn.hbm.continuation.bordered_modes import Bordered, DenseBordered, DiagonalBordered, StuckModes
from tribodyn.hbm.krylov import gmres
from tribodyn.refusal import Refusal

LOWEST_MODES = 120  # lowest modes among which the reference mode of a turning or a flown-about structure is looked for


@dataclass(frozen=True)
class ModePoint:
    """x (n_pair, c, n_coeff), omega, zeta at amplitude a, and what they give.

    coordinates : (n_contact * n_coeff + 3,) the same, scaled
    residual : (n_contact * n_coeff + 2,), scaled; eta : complex modal amplitudes (n, n_harmonic)
    factors : the bordered dynamic stiffness of each harmonic, ready to be solved"""

    coordinates: np.ndarray
    a: float
    x: np.ndarray
    omega: float
    zeta: float
    cycle: ContactCycle
    eta: np.ndarray
    residual: np.ndarray
    factors: list[Bordered]


class FreeVibration:
    """The problem of one reference mode.

    balance : of one structure or of a travelling wave of a wheel; its vibration load plays no part
    mode : number of the reference mode, from 0, of the structure stuck where the static load keeps it closed; None for
        the one with the least damping
    output : whose motion in the reference mode measures the amplitude
    reference_omega : [rad/s]; reference_damping : ratio of the mode with Coriolis forces, damping and flow
    per_amplitude : motion of the output per modal amplitude a; one_system : whether all harmonics see the same
    Raises  ValueError for what has no such mode"""

    def __init__(self, balance: HarmonicBalance, mode: int | None, output: str | None):
        model, self.balance, self.basis, self.mode = balance.model, balance, balance.basis, mode
        model.require_masters("nonlinear modes")
        if not model.has_one_system and not model.is_wave:
            raise Refusal(
                "nonlinear modes need one system for all harmonics: this model has one of its own per harmonic"
            )
        if 1 not in self.basis.harmonics:
            raise Refusal("nonlinear modes need harmonic 1 among the harmonics")
        names = balance.compliance.output_names
        if not names or (output is not None and output not in names):
            raise Refusal(f"no output '{output}' to measure the amplitude: the model has {', '.join(names) or 'none'}")
        self.k = balance.compliance.k
        modes_of_system: dict[int, StuckModes] = {}
        self.modes: list[StuckModes] = []
        for h in self.basis.harmonics:
            system, b = model.at_harmonic(h)
            if id(system) not in modes_of_system:
                modes_of_system[id(system)] = StuckModes(system, np.asarray(b), self.k, names)
            self.modes.append(modes_of_system[id(system)])
        self.one_system = len(modes_of_system) == 1
        self.first = self.basis.harmonics.index(1)
        self.n = len(self.modes[self.first].lam)
        static, b = model.at_harmonic(self.basis.harmonics[0])
        load = balance.excitation.force(0, static.loads, static.n_dof)
        base = balance.excitation.base
        self.base = np.zeros(len(b)) if base is None or not self.basis.has_static else base[:, 0]
        still = self.modes[0]
        self.static_load = np.real(still.shapes.conj().T @ load + still.UH @ (self.k * self.base))
        self.rest_x, open_rows = self._static_state()
        self.reference, self.reference_omega, self.reference_damping = self._reference(mode, open_rows)
        self.output = output or names[0]
        output_motion = self.modes[self.first].O @ self.reference
        self.per_amplitude = float(abs(output_motion[names.index(self.output)]))
        if self.per_amplitude <= 1e-9 * np.abs(self.modes[self.first].O).max():
            raise Refusal(f"output '{self.output}' does not move in mode {mode}: choose another output")

    def _reference(self, mode: int | None, open_rows: np.ndarray) -> tuple[np.ndarray, float, float]:
        """Modal shape (n,) of unit mass, frequency [rad/s] and damping ratio of the reference mode."""
        m = self.modes[self.first]
        squares, shapes = self._still = self._at_rest(open_rows)
        if mode is not None and not 0 <= mode < self.n:
            raise Refusal(f"there is no mode {mode}: the model has modes 0 to {self.n - 1}")
        system, _ = self.balance.model.at_harmonic(1)
        if mode is not None and system.gyroscopic is None and system.circulatory is None:
            if squares[mode] <= 1e-13 * squares[-1]:
                raise Refusal(f"mode {mode} is a rigid-body motion at rest: choose one that vibrates")
            shape, omega = shapes[:, mode], float(np.sqrt(squares[mode]))
            return shape, omega, float(np.real(shape.conj() @ m.damping @ shape)) / (2 * omega)
        lowest = shapes[:, : min(self.n, LOWEST_MODES)]  # what turns and what flows couples the lowest ones
        stiffness = np.diag(squares[: lowest.shape[1]]) + (0.0 if m.flow is None else lowest.conj().T @ m.flow @ lowest)
        rate = lowest.conj().T @ m.damping @ lowest
        size = lowest.shape[1]
        values, vectors = np.linalg.eig(np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -rate]]))
        values, vectors = values[values.imag > 0], vectors[:size, values.imag > 0]
        order = np.argsort(values.imag) if mode is not None else np.argsort(-values.real)
        value, shape = values[order[mode or 0]], lowest @ vectors[:, order[mode or 0]]
        return shape / np.linalg.norm(shape), float(value.imag), float(-value.real / abs(value))

    def _at_rest(self, open_rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Squared frequencies and modal shapes of the structure stuck where it is closed at rest."""
        m = self.modes[self.first]
        open_springs = m.UH[:, open_rows] @ (self.k[open_rows, None] * m.U[open_rows])
        squares, shapes = np.linalg.eigh(np.diag(m.lam) - open_springs)
        return squares, shapes

    def about_rest(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies (k,) [rad/s] and damping ratios of all small vibrations about the static equilibrium.

        Coriolis and circulatory forces are left out, and so are motions as a rigid body."""
        squares, shapes = self._still
        rate = np.real(np.einsum("ij,ij->j", shapes.conj(), self.modes[self.first].damping @ shapes))
        vibrates = squares > 1e-13 * squares[-1]
        omega = np.sqrt(squares[vibrates])
        return omega, rate[vibrates] / (2 * omega)

    def _static_state(self) -> tuple[np.ndarray, np.ndarray]:
        """x at rest, and which contacts are open there."""
        still = self.balance.with_load(0.0)
        solution = newton.solve(still, still.omega_max, still.stuck(still.omega_max))
        if not solution.converged:
            raise Refusal(f"no static equilibrium for a nonlinear mode to vibrate about: {solution.outcome}")
        is_open = solution.state.cycle.status & SEPARATES > 0
        return solution.state.x, np.repeat(is_open, solution.state.x.shape[1])

    def first_guess(self, a: float) -> ModePoint:
        """The reference mode about the static equilibrium."""
        x = self.rest_x.copy()
        shape = (self.modes[self.first].U @ self.reference).reshape(x.shape[:2])
        cosine = int(np.flatnonzero(self.basis.order == 1)[0])
        x[:, :, cosine] += a * shape.real
        x[:, :, cosine + 1] -= a * shape.imag
        return self.at(x, self.reference_omega, self.reference_damping, a)

    def at(self, x: np.ndarray, omega: float, zeta: float, a: float) -> ModePoint:
        """Everything at x (n_pair, c, n_coeff), frequency, damping ratio and modal amplitude."""
        flat = x.reshape(self._shape) / self._units(a)
        return self.evaluate(np.concatenate([flat.ravel(), [np.log(omega), zeta, np.log(a)]]))

    @property
    def _shape(self) -> tuple[int, int]:
        return len(self.k), self.basis.n_coeff

    def _units(self, a: float) -> np.ndarray:
        """(n_coeff,) displacement per coordinate: for x_0 that of rest, for the rest the amplitude."""
        vibration = float(np.linalg.norm(self.modes[self.first].U @ self.reference))
        still = float(np.linalg.norm(self.rest_x[:, :, 0])) if self.basis.has_static else 0.0
        return np.where(self.basis.order == 0, still or a * vibration, a * vibration)

    def weights(self, a: float) -> np.ndarray:
        """(n_contact * n_coeff,) of the coordinates of x in an arc length: x_0 counts over rest or the vibration."""
        units = self._units(a)
        return np.tile((units / np.maximum(units, units[-1])) ** 2, len(self.k))

    def evaluate(self, coordinates: np.ndarray) -> ModePoint:
        """Everything at one point."""
        omega, a = (float(np.exp(c)) for c in coordinates[[-3, -1]])
        zeta = float(coordinates[-2])
        flat = coordinates[:-3].reshape(self._shape) * self._units(a)
        x = flat.reshape(self.rest_x.shape)
        cycle = self.balance.contact.cycle(x, self.basis, self.balance.memory)
        g = self.k[:, None] * flat - cycle.force.reshape(flat.shape)
        factors: list[Bordered] = []
        for h, m in zip(self.basis.harmonics, self.modes, strict=True):
            s = 1j * h * omega
            undamped = (m.lam if h else m.static_lam) + s * s - 2 * zeta * omega * s
            none = np.zeros(self.n)
            border, corner = (self.reference, 0.0) if h == 1 else (none, 1.0)
            if m.proportional or (not h and m.flow is None):
                factors.append(DiagonalBordered(undamped + s * np.diag(m.damping), border, corner, border.conj()))
            else:
                flow = 0.0 if m.flow is None else m.flow
                factors.append(DenseBordered(s * m.damping + np.diag(undamped) + flow, border, corner, border.conj()))
        rhs = self._rhs(self._modal(self.basis.to_complex(g)), a)
        if self.basis.has_static:
            rhs[:-1, 0] += self.static_load
        eta, mismatch = self._solve(factors, rhs)
        move = self._contact_motion(eta)
        if self.basis.has_static:
            move[:, 0] -= self.base
        residual = self._residual(a, flat - move, mismatch)
        return ModePoint(coordinates, a, x, omega, zeta, cycle, eta, residual, factors)

    def _modal(self, force: np.ndarray) -> np.ndarray:
        """Modal forces (n, n_harmonic) of contact forces (n_contact, n_harmonic)."""
        if self.one_system:
            to_modes = self.modes[0].UH
            if np.isrealobj(to_modes):  # a product of real matrices is not one of complex copies
                return to_modes @ force.real + 1j * (to_modes @ force.imag)
            return to_modes @ force
        return np.stack([m.UH @ force[:, i] for i, m in enumerate(self.modes)], axis=1)

    def _contact_motion(self, eta: np.ndarray) -> np.ndarray:
        """Contact displacement (n_contact, n_coeff) of modal amplitudes (n, n_harmonic)."""
        if self.one_system:
            from_modes = self.modes[0].U
            if np.isrealobj(from_modes):
                return from_modes @ self.basis.to_real(eta)
            return self.basis.to_real(from_modes @ eta)
        return self.basis.to_real(np.stack([m.U @ eta[:, i] for i, m in enumerate(self.modes)], axis=1))

    def _rhs(self, modal_force: np.ndarray | float, a: float) -> np.ndarray:
        """(n + 1, n_harmonic) right-hand side of the bordered systems."""
        rhs = np.zeros((self.n + 1, len(self.basis.harmonics)), complex)
        rhs[:-1] = modal_force
        rhs[-1, self.basis.harmonics.index(1)] = a
        return rhs

    def _solve(self, factors: list[Bordered], rhs: np.ndarray) -> tuple[np.ndarray, complex]:
        """Modal amplitudes, and what is missing along the reference mode in harmonic 1."""
        out = np.stack([f.solve(rhs[:, i]) for i, f in enumerate(factors)], axis=1)
        return out[:-1], out[-1, self.basis.harmonics.index(1)]

    def _residual(self, a: float, x: np.ndarray, mismatch: complex) -> np.ndarray:
        """x_0 relative to rest and vibration, the vibration and the mismatch relative to the vibration."""
        vibration = self._units(a)[-1]
        scale = np.where(self.basis.order == 0, np.maximum(self._units(a), vibration), vibration)
        relative = mismatch / (self.reference_omega**2 * a)
        return np.concatenate([(x / scale).ravel(), [relative.real, relative.imag]])

    def correction(
        self, p: ModePoint, normal: np.ndarray, tolerance: float, max_products: int, distance: float = 0.0
    ) -> np.ndarray:
        """Newton direction for the coordinates to the hyperplane normal to `normal`, `along` of it away from p."""
        jac = p.cycle.slope
        units = self._units(p.a)
        dynamic = np.where(self.basis.order == 0, 0.0, p.x.reshape(self._shape))
        by_omega, by_zeta, by_a = self._slopes(p)
        size = float(np.linalg.norm(normal))

        def product(y: np.ndarray) -> np.ndarray:
            d = y[:-3].reshape(self._shape) * units + y[-1] * dynamic
            dg = self.k[:, None] * d - np.matmul(jac, d.reshape(len(jac), -1, 1)).reshape(d.shape)
            eta, mismatch = self._solve(p.factors, self._rhs(self._modal(self.basis.to_complex(dg)), 0.0))
            out = self._residual(p.a, d - self._contact_motion(eta), mismatch)
            return np.append(out + y[-3] * by_omega + y[-2] * by_zeta + y[-1] * by_a, normal @ y / size)

        return gmres(product, np.append(-p.residual, distance / size), tolerance, max_products)[0]

    def _slopes(self, p: ModePoint) -> tuple[np.ndarray, ...]:
        """Derivatives of the residual at fixed x by the logarithm of omega, by zeta and by the logarithm of a."""
        h = np.asarray(self.basis.harmonics)
        damped = np.stack([m.damping @ p.eta[:, i] for i, m in enumerate(self.modes)], axis=1)
        by_omega = 1j * h * damped + (-2 * h**2 * p.omega - 4j * p.zeta * h * p.omega) * p.eta
        by_zeta = (-2j * h * p.omega**2) * p.eta
        slopes = []
        for rhs in (self._rhs(-p.omega * by_omega, 0.0), self._rhs(-by_zeta, 0.0), self._rhs(0.0, p.a)):
            eta, mismatch = self._solve(p.factors, rhs)
            slopes.append(self._residual(p.a, -self._contact_motion(eta), mismatch))
        return tuple(slopes)

    def outputs(self, p: ModePoint) -> np.ndarray:
        """(n_output, n_coeff) response of the observed outputs [m]."""
        return self.basis.to_real(np.stack([m.O @ p.eta[:, i] for i, m in enumerate(self.modes)], axis=1))
