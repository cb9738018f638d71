"""Broken structures: what is wrong is one sentence with the key or the place, and the cure."""

from pathlib import Path

import pytest

from tests.helpers.structures import BLOCKS, FREE, STACK, built

PART = 'part = "block"\nlength = "40 mm"\nwidth = "14 mm"\nn_length = 3\nn_width = 1\n'
UPPER, LOWER = 'group = "upper.z_max"\npressure', 'group = "lower.x_max"\ndirection = "x"\n'
TITANIUM = 'young = "70 GPa"\npoisson = 0.33'
CRYSTAL = 'young = ["70 GPa", "60 GPa", "50 GPa"]\npoisson = [{0}, 0.3, 0.3]\nshear = ["30 GPa", "30 GPa", "30 GPa"]'
POINT = '[couplings.point]\nface = "upper.z_max"\n'
BY = "friction = 0.3"

Change = tuple[str, str]
BROKEN: dict[str, tuple[str, tuple[Change, ...], str, str]] = {  # name : scene, changes, what is added, what is said
    # names
    "missing face": (BLOCKS, (("lower.z_max", "lower.top"),), "", r"contact of 'upper.z_min' .*no face 'lower.top'"),
    "misspelt face": (BLOCKS, (("lower.z_max", "lover.z_max"),), "", r"did you mean 'lower.z_max'\?"),
    "face without its body": (BLOCKS, (('"upper.z_min"', '"z_min"'),), "", "no face 'z_min'"),
    "missing clamp": (BLOCKS, (('"x_min"', '"x_minn"'),), "", r"did you mean 'lower.x_min'\?"),
    "missing response": (BLOCKS, ((LOWER + "freq", LOWER.replace("x_max", "end") + "freq"),), "", "set 'lower.end'"),
    "missing coupled face": (BLOCKS, (), '[couplings.p]\nface = "upper.top"\n', "no node set 'upper.top'"),
    "missing coupling": (BLOCKS, (), POINT + '[links.l]\nfirst = "point"\nsecond = "pt"\n', "links.l: .*couplings.pt"),
    "mass nowhere": (BLOCKS, (), '[masses.m]\nat = "upper.top"\nmass = "1 kg"\n', "no node set 'upper.top'"),
    "spring nowhere": (BLOCKS, (), '[springs.s]\ngroup = "lower.top"\ndirection = "x"\nstiffness = "1 N/m"\n',
        "no .* set 'lower.top'"),
    "heat of no body": (BLOCKS, (), '[loads.static.h]\ntemperature = "4 K"\nbodies = ["uper"]\n', "no body 'uper'"),
    "two bodies of one name": (BLOCKS, (("[bodies.upper]", "[bodies.lower]"),), "", "'lower'. twice"),
    "dot in a name": (BLOCKS, (("[bodies.upper]", '[bodies."up.per"]'),), "", "without a dot"),
    "body called ground": (BLOCKS, (("[bodies.upper]", "[bodies.ground]"),), "", 'not "ground"'),
    "coupling called as a body": (BLOCKS, (), POINT.replace("point", "upper"),
        "couplings.upper has the name of a body"),
    "bolt called as a load": (STACK, (("[bolts.m8]", "[bolts.shake]"),), "", "bolts.shake has the name of a load"),
    # places
    "faces apart": (BLOCKS, (('"10 mm"]', '"60 mm"]'),), "", r"do not meet: .* apart.*; move a body, or give reach"),
    "bodies that overlap": (BLOCKS, (('"10 mm"]', '"4 mm"]'),), "", "bodies.lower overlaps upper: 50% .*move one"),
    "bodies in one place": (BLOCKS, (('["55 mm", "3 mm", "10 mm"]', "[0, 0, 0]"),), "", "overlaps upper"),
    "face deep inside": (BLOCKS, (('"10 mm"]', '"4.9 mm"]'), (BY, BY + '\nreach = "1 mm"')), "",
        "overlap|about 0.0051 m inside"),
    "faces that look alike": (BLOCKS, (('"lower.z_max"', '"lower.z_min"'),), "", "look the same way: give faces that"),
    "contact of a face with itself": (BLOCKS, (('"lower.z_max"', '"upper.z_min"'),), "", "contacts.lap: .*one face"),
    "tie of a face with itself": (BLOCKS, (), '[ties.g]\nfirst = "upper.x_min"\nsecond = "upper.x_min"\n',
        "ties.g: .*one"),
    "tie where faces touch": (BLOCKS, (), '[ties.g]\nfirst = "upper.z_min"\nsecond = "lower.z_max"\n',
        "contacts.lap and ties.g join"),
    "tie that is apart": (BLOCKS, (), '[ties.g]\nfirst = "upper.x_min"\nsecond = "lower.x_max"\n',
        "ties.g: the two faces do not meet: they"),
    "nodes that do not match": (BLOCKS, ((BY, BY + '\npairing = "nodes"'),), "", "do not match: 20 of 21 .*same grid"),
    "tangent along the normal": (BLOCKS, (('t1 = "x"', 't1 = "z"'),), "", "t1 = .* give one along the face"),
    "bolt that crosses nothing": (STACK, (('second = "b.x_max"', 'second = "a.x_min"'),), "",
        "m8 crosses nothing: .*give"),
    "bolt that pulls": (STACK, (('first = "a.x_min"\nsecond', 'first = "a.x_max"\nsecond'),), "", "would pull at 'a"),
    "face of no rule": (BLOCKS, (("n_width = 1\n", "n_width = 1\nfaces = {a = {}}\n"),), "", "expected a rule: box"),
    "face where nothing is": (BLOCKS,
        (("n_width = 1\n", "n_width = 1\nfaces = {a = {box = [[1, 1, 1], [2, 2, 2]]}}\n"),), "",
        "faces.a: no face of the boundary lies within the box"),
    "face of a CAD file on a part": (BLOCKS, (("n_width = 1\n", "n_width = 1\nfaces = {a = {cad = [3]}}\n"),), "",
        "no face 3 of a CAD file"),
    "volume that is not there": (BLOCKS, (("n_width = 1\n", 'n_width = 1\nvolume = "core"\n'),), "",
        "no volume 'core'"),
    # what holds and loads
    "nothing holds a body": (FREE, (), "", r"nothing holds lower and upper, .*\(0, 0, -400\) N .*clamp them or add"),
    "load on a clamp": (BLOCKS, ((LOWER + "val", LOWER.replace("x_max", "x_min") + "val"),), "", "load 'pull' .* held"),
    "response of a clamp": (BLOCKS, ((LOWER + "freq", LOWER.replace("x_max", "x_min") + "freq"),), "",
        "output 'response' .*name a group"),
    "axes of a clamp": (BLOCKS, (('fixed = ["x_min"]', 'fixed_axes = {x_min = "w"}'),), "", "letters x, y, z"),
    "pressure on a volume": (BLOCKS, ((UPPER, UPPER.replace("z_max", "block")),), "", "no face 'upper.block'"),
    "two kinds of load": (BLOCKS, (("0.5 MPa", '0.5 MPa"\nvalue = "3 N'),), "",
        "press: expected one out of value, press"),
    "moment on a face": (BLOCKS, (), '[loads.static.m]\ngroup = "upper.z_max"\ndirection = "z"\nmoment = "4 N m"\n',
        "couple the group"),
    "heat that expands nothing": (BLOCKS, (('expansion = "12e-6 1/K"\n', ""), ('expansion = "23e-6 1/K"\n', "")),
        '[loads.static.h]\ntemperature = "4 K"\n', "give its material an expansion"),
    "point held that follows": (BLOCKS, (), POINT + 'fixed = ["x"]\n', 'couplings.point: .*give kind = "rigid"'),
    "kind of coupling": (BLOCKS, (), POINT + 'kind = "stiff"\n', "kind: expected 'rigid' or 'distributed'"),
    "bolt without stiffness": (STACK, (('stiffness = "90 N/um"\n', ""),), "", "bolts.m8: a locked bolt needs"),
    "state of a bolt": (STACK, (('"90 N/um"', '"90 N/um"\nstate = "loose"'),), "", "expected 'locked' or 'constant'"),
    # units and numbers
    "body in millimetres": (BLOCKS, (('length = "40 mm"', "length = 40.0"),), "",
        "it is 40.* m long, as .* millimetres"),
    "length in newton": (BLOCKS, (('"100 mm"', '"100 N"'),), "", "bodies.lower: length: expected a length"),
    "density in gram": (BLOCKS, (('"2700 kg/m3"', '"2.7 g"'),), "", "aluminium.density: .* which is a mass"),
    "modulus in millimetres": (BLOCKS, (('"70 GPa"', '"70 mm"'),), "",
        "^scene.toml: materials.aluminium.young: [^;]*mm.*h$"),
    "modulus below zero": (BLOCKS, (('"70 GPa"', '"-70 GPa"'),), "", "aluminium.young: expected a value above 0"),
    "incompressible": (BLOCKS, (("0.33", "0.5"),), "", "aluminium.poisson: expected a value below 0.5, got 0.5$"),
    "preload as a pressure": (STACK, (('"5 kN"', '"5 MPa"'),), "", "bolts.m8.preload: expected a force .*a pressure"),
    "stiffness as a force": (BLOCKS, (('"100 N/um"', '"100 N"'),), "",
        "lap.tangential_stiffness: expected a stiffness"),
    "turn in millimetres": (BLOCKS, (("translation =", 'rotation = {axis = "z", angle = "1 mm"}\ntranslation ='),), "",
        "an angle [^;]*$"),
    "turn about nothing": (BLOCKS, (("translation =", "rotation = {axis = [0, 0, 0], angle = 1}\ntranslation ="),), "",
        "all zero[^;]*$"),
    "place of two numbers": (BLOCKS, ((', "10 mm"]', "]"),), "", r"upper.translation\[2\] is missing"),
    "no elements": (BLOCKS, (("n_length = 4", "n_length = 0"),), "", "n_length is 0: give a whole number"),
    "friction below zero": (BLOCKS, ((BY, "friction = -0.3"),), "", "friction: expected a value at least 0"),
    # materials and files
    "missing material": (BLOCKS, (('"aluminium"', '"gold"'),), "", "bodies.upper: .*materials.gold, known here: steel"),
    "no material": (BLOCKS, (('material = "aluminium"\n', ""),), "", "bodies.upper.material is missing"),
    "one of three moduli": (BLOCKS, (('"70 GPa"', '["70 GPa", "6 GPa", "5 GPa"]'),), "", "three values each of young"),
    "material that gives energy": (BLOCKS, ((TITANIUM, CRYSTAL.format(1.5)),), "",
        "upper: .*Poisson's ratios .*gain energy"),
    "axes that are parallel": (BLOCKS, ((TITANIUM, CRYSTAL.format(0.3) + '\naxes = ["x", "x"]'),), "",
        "directions that are not parallel"),
    "law that is not there": (BLOCKS, ((BY, BY + '\nlaw = "coulom"'),), "", "no contact law 'coulom': there are"),
    "wear of one joint": (BLOCKS, ((BY, BY + "\nwear = {coefficient = 1e-15}"),), "", r"lap.wear needs \[wear\]"),
    "size of a part": (BLOCKS, (("n_width = 1\n", 'n_width = 1\nsize = "3 mm"\n'),), "",
        "a part has parameters of its"),
    "part and mesh": (BLOCKS, (("n_width = 1\n", 'n_width = 1\nmesh = "a.msh"\n'),), "", "and not both"),
    "missing mesh": (BLOCKS, ((PART, 'mesh = "none.msh"\n'),), "",
        "bodies.upper: mesh file .*none.msh' does not exist"),
    "mesh that is none": (BLOCKS, ((PART, 'mesh = "text.msh"\n'),), "", "text.msh' cannot be read .*write it as"),
    "deck without elements": (BLOCKS, ((PART, 'mesh = "empty.inp"\n'),), "", "empty.inp' has no volume elements: mesh"),
    "map without rows": (BLOCKS, ((BY, BY + '\ngap_map = "map.csv"'),), "", "gap_map: expected four rows or more"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_structure_is_one_sentence(name: str, tmp_path: Path) -> None:
    text, changes, extra, message = BROKEN[name]
    for previous, updated in changes:
        assert previous in text
        text = text.replace(previous, updated, 1)
    (tmp_path / "text.msh").write_text("hello\n")
    (tmp_path / "empty.inp").write_text("*Heading\n")
    (tmp_path / "map.csv").write_text("1, 2, 3\n")
    with pytest.raises(ValueError, match=message) as raised:
        built(text + extra, tmp_path)
    assert "\n" not in str(raised.value)
    assert "function-" not in str(raised.value)
