"""Coarse settings of the beam, of the blade and of the rig, for tests that need their scenes and not their numbers."""

BEAM = (
    "harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine", "geometry.n_patch=3",
    "geometry.n_length=2", "geometry.n_height=1", "reduction.modes=3", "response.points=6",
)  # fmt: skip
BLADE = (
    "geometry.n_span=4", "geometry.n_side=1", "geometry.n_root=1", "reduction.cutoff=6 kHz", "response.points=40",
    "wear.step=40 %", "verdict.enabled=false",
)  # fmt: skip
RIG = (
    "geometry.n_contact_length=3", "geometry.n_contact_width=5", "reduction.modes=6", "harmonics.kept=[0, 1]",
    "harmonics.samples=32", "harmonics.transitions=sampled", "verdict.enabled=false",
    "wear.rule=thesis", "wear.step=2 %", "wear.motion=balance", "wear.end_at=vibrating",
)  # fmt: skip
QUICK_RIG = (
    *RIG, "damping.modal=6 %", "wear.step=15 %", "wear.lost_below=30 %", "wear.max_steps=60",
    "response.frequency=['270 Hz', '310 Hz']",
)  # fmt: skip
