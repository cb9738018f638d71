"""Response of the thesis's beam beside the dense algorithm, tables 7.1 and 7.2 of the thesis, one thread, one run.

Both follow the same frequencies with the same predictor, law, samples and tolerance. The dense algorithm is timed at
consecutive points in three parts of the range, predicted from solutions of the other. Ratio: of seconds a point."""

from collections.abc import Callable, Sequence
from time import process_time

import numpy as np

from proof.dense import DenseBalance
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.threads import limited
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

POINTS, SAMPLES, TOLERANCE, REPEATS = 201, 100, 1e-8, 5


def run(highest: Sequence[int], dense_points: int, say: Callable[[str], None]) -> None:
    """Say a line for the harmonics 0 to each of `highest`; dense_points : in each part of the range."""
    file = scene_file.read("beam_thesis", ())
    low, high = settings.response_range(file.scene)
    say("harmonics  seconds  points solved  ratio  largest difference")
    with limited(1):
        model = modelling.build(file, Progress())
        for h in highest:
            basis = HarmonicBasis(tuple(range(h + 1)), SAMPLES)
            balance = model.balance.of(
                model.reduced, model.balance.contact.joints, basis, model.balance.excitation, model.balance.omega_max
            )
            options, times = natural.Options(n_points=POINTS, newton=NewtonOptions(TOLERANCE)), []
            for _ in range(REPEATS + 1):  # the first one compiles
                clock = process_time()
                branch = natural.follow(balance, high, low, options)
                times.append(process_time() - clock)
            dense, spent, difference, count = DenseBalance(balance), 0.0, 0.0, len(branch.omega)
            for start in np.linspace(2, count - dense_points - 3, 3).astype(int).tolist():
                near = branch.omega[start : start + 3 + dense_points]
                guesses = map(balance.shaped, branch.contact[start:])
                exact = [newton.solve(balance, w, next(guesses), NewtonOptions(1e-12)).state.x for w in near]
                q = [dense.coordinates_of(w, x) for w, x in zip(near, exact, strict=True)]
                for i in range(3, len(near)):
                    clock = process_time()
                    solution = dense.solve(
                        near[i], natural.extrapolate(near[i - 3 : i], q[i - 3 : i], near[i]), TOLERANCE
                    )
                    spent += process_time() - clock
                    off = dense.solve(near[i], solution.q, 1e-12, 4).x - exact[i]
                    difference = max(difference, np.abs(off).max() / np.abs(exact[i]).max())
            seconds = min(times[1:])
            ratio = spent / (3 * dense_points) / (seconds / count)
            say(f"0 to {h:<4} {seconds:8.2f} {branch.converged.sum():7}/{count:<6} {ratio:6.0f} {difference:19.1e}")
