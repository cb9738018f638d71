"""A small wheel of a few sectors as the text of its scene file."""

WHEEL = """
[scene]
title = "Six coarse blades on a flexible disk"
[geometry]
part = "blade"
fixed = ["clamp"]
n_blades = 6
hub_radius = "60 mm"
span = "80 mm"
root_chord = "35 mm"
tip_chord = "24 mm"
root_thickness = "10 mm"
tip_thickness = "8 mm"
contact_length = "20 mm"
contact_height = "12 mm"
shroud_length = "50 mm"
root_height = "15 mm"
root_length = "60 mm"
disk_radius = "25 mm"
n_along = 2
n_up = 2
n_span = 3
n_side = 1
n_root = 1
n_disk = 1
[material]
young = "210 GPa"
density = "7860 kg/m3"
poisson = 0.3
[wheel]
sectors = 6
engine_order = 1
axis = "x"
seam = ["cyclic_right", "cyclic_left"]
[contact]
group = "shroud_right"
opposite = "shroud_left"
t1 = "x"
vertices_only = true
tangential_stiffness = "9 N/um"
normal_stiffness = "11 N/um"
friction = 5.0
gap = "-0.1 mm"
[loads.harmonic.wave]
group = "excitation"
direction = "y"
value = "20 N"
[response]
group = "tip"
direction = "y"
frequency = ["400 Hz", "404 Hz"]
points = 5
[reduction]
modes = 6
[harmonics]
kept = [0, 1]
samples = 32
[damping]
modal = "2 %"
"""

FLOW = """
[flow]
influence = [[0, 0, 0.012], [1, 0.012, 0.002], [-1, -0.012, 0.002]]
"""
