"""Two blocks

One block is pressed on another and shaken. A scene is a dict of tables, and each quantity a text with its unit.
"""

import tribodyn as td

steel = {"young": "210 GPa", "density": "7850 kg/m3"}
block = {"part": "block", "length": "20 mm", "width": "20 mm", "height": "10 mm", "n_length": 3, "n_width": 3}
scene = {
    "materials": {"steel": steel},
    "bodies": {
        "lower": block | {"material": "steel", "fixed": ["z_min"]},
        "upper": block | {"material": "steel", "translation": ["0 mm", "0 mm", "10 mm"]},
    },
    "contacts": {
        "joint": {
            "first": "upper.z_min",
            "second": "lower.z_max",
            "tangential_stiffness": "50 N/um",
            "normal_stiffness": "60 N/um",
            "friction": 0.3,
        }
    },
    "loads": {
        "static": {"press": {"group": "upper.z_max", "direction": "-z", "value": "500 N"}},
        "harmonic": {"shake": {"group": "upper.z_max", "direction": "x", "value": "60 N"}},
    },
    "response": {"frequency": ["3 kHz", "8 kHz"], "points": 80},
    "harmonics": {"kept": [0, 1, 2, 3]},
    "reduction": {"modes": 4},
    "damping": {"modal": "1 %"},
    "verdict": {"enabled": False},
}
result = td.run(scene)
print(f"peak at {result.summary()['peak_frequency']['first']:.0f} Hz")
td.plot.response(result).savefig("response.png")
