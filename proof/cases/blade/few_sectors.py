"""A wheel of eight small coarse blades, few enough to be solved as a whole (ours)."""

FEW_SECTORS = (  # ours: a wheel of eight small blades, coarse
    "wheel.sectors=8", "wheel.engine_order=2", "geometry.n_blades=8", "geometry.hub_radius=60 mm",
    "geometry.span=80 mm", "geometry.root_chord=35 mm", "geometry.tip_chord=24 mm", "geometry.root_thickness=10 mm",
    "geometry.tip_thickness=8 mm", "geometry.shroud_angle=35 deg", "geometry.contact_length=20 mm",
    "geometry.contact_height=12 mm", "geometry.shroud_length=35 mm", "geometry.root_height=15 mm",
    "geometry.root_length=50 mm", "geometry.n_along=3", "geometry.n_up=2", "geometry.n_span=4", "geometry.n_side=1",
    "geometry.n_root=1", 'loads.static.untwist_trailing={group = "couple_trailing", direction = "y", value = "4 kN"}',
    'loads.static.untwist_leading={group = "couple_leading", direction = "-y", value = "4 kN"}',
    "loads.harmonic.wave.value=1 kN", "reduction.cutoff=20 kHz", "response.frequency=[850, 1150]",
)  # fmt: skip
