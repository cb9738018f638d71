"""Curves of pyHarm as JSON, by the interpreter that has it: python peers_pyharm.py, problems on standard input."""

import json
import logging
import sys
import time
import warnings

import numpy as np


def problem(request: dict) -> dict:
    """The input of pyHarm: a chain of masses, each with a Jenkins element or a cubic spring to the ground."""
    stiffness = np.array(request["stiffness"])
    n = len(stiffness)
    matrices = {"M": np.eye(n), "K": stiffness, "C": np.array(request["damping"])}
    elements = {"force": {"type": "CosinusForcing", "connect": {"chain": [0]}, "dirs": [0], "amp": request["force"]}}
    for i in range(n):
        elements[f"contact {i}"] = {**request["element"], "connect": {"chain": [i]}, "dirs": [0]}
    low, high = request["range"]
    analysis = {
        "study": "frf", "solver": "NewtonRaphson", "predictor": "tangent", "corrector": "arc_length",
        "puls_inf": low, "puls_sup": high, "ds0": request["step"], "ds_max": request["step"], "verbose": False,
        "solver_options": {"tol_residual": request["tolerance"], "tol_delta_x": request["tolerance"], "max_iter": 30},
    }  # fmt: skip
    return {
        "system": {"type": "Base", "nh": request["harmonics"], "nti": request["samples"]},
        "substructures": {"chain": {"matrix": matrices, "ndofs": 1, "nnodes": n}},
        "connectors": elements,
        "analysis": {"curve": analysis},
    }


def curve(request: dict) -> dict:
    """Least processor seconds of some repetitions, frequencies [rad/s] and coefficients (n_point, n_coeff, n)."""
    from pyHarm.Maestro import Maestro

    seconds = []
    for _ in range(request["repeat"]):
        maestro = Maestro(problem(request))
        began = time.process_time()
        maestro.operate()
        seconds.append(time.process_time() - began)
    points = [s.x for s in maestro.nls["curve"].SolList if s.flag_accepted]
    n = len(request["stiffness"])
    x = [np.asarray(v[:-1]).reshape(-1, n).tolist() for v in points]
    return {"seconds": min(seconds), "omega": [float(v[-1]) for v in points], "x": x}


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    print(json.dumps([curve(request) for request in json.load(sys.stdin)]))
