"""The cards of Abaqus and CalculiX that are read, what stands on them, and the others that change nothing here."""

from tribodyn.geometry.sources.card_table import CardTable

ANY = "..."
# card -> its parameters, and the fields of a data line; see card_table
GRAMMAR: dict[str, tuple[str, str]] = {
    "NODE": ("NSET, SYSTEM=R|C|S, INPUT", "label, x, y, z, (normal 1), (normal 2), (normal 3)"),
    "ELEMENT": ("TYPE, ELSET, INPUT", ANY),
    "NSET": ("NSET, ELSET, INSTANCE, GENERATE, UNSORTED, (INTERNAL)", ANY),
    "ELSET": ("ELSET, INSTANCE, GENERATE, (UNSORTED), (INTERNAL)", ANY),
    "SURFACE": ("NAME, TYPE=ELEMENT|NODE, COMBINE=UNION, (INTERNAL)", ANY),
    "SOLID SECTION": ("ELSET, MATERIAL, ORIENTATION, (CONTROLS)", "(thickness)"),
    "PART": ("NAME", ""),
    "END PART": ("", ""),
    "INSTANCE": ("NAME, PART", "x, y, z; x of axis, y, z, x of a second point, y, z, angle;"),
    "END INSTANCE": ("", ""),
    "ASSEMBLY": ("(NAME)", ""),
    "END ASSEMBLY": ("", ""),
    "INCLUDE": ("INPUT", ""),
    "SYSTEM": ("", "x, y, z, x of first axis, y, z; x in the plane, y, z;"),
    "ORIENTATION": ("NAME, DEFINITION=COORDINATES, SYSTEM=RECT|ZRECT|CYL|SPH, (LOCAL DIRECTIONS)", "...; axis, angle;"),
    "DISTRIBUTION": ("NAME, (LOCATION), (TABLE), INPUT", "element, x, y, z, x, y, z"),
    "MATERIAL": ("NAME", ""),
    "ELASTIC": ("TYPE=ISO|ORTHO|ENG|ANISO, (MODULI)", ANY),
    "DENSITY": ("", "density, temperature"),
    "EXPANSION": ("TYPE=ISO, (ZERO)", "coefficient, temperature"),
    "MASS": ("ELSET, TYPE=ISO, (ALPHA), (COMPOSITE)", "mass;"),
    "SPRING": ("ELSET", "direction or stiffness, direction"),
    "TIE": ("NAME, POSITION TOLERANCE, (ADJUST), (TYPE), (NO ROTATION), (NO THICKNESS)", "slave, master"),
    "EQUATION": ("INPUT", ANY),
    "COUPLING": ("CONSTRAINT NAME, REF NODE, SURFACE", ""),
    "KINEMATIC": ("", "first axis, last axis"),
    "DISTRIBUTING": ("WEIGHTING METHOD=UNIFORM, (COUPLING)", "first axis, last axis"),
    "KINEMATIC COUPLING": ("REF NODE", "nodes, first axis, last axis"),
    "DISTRIBUTING COUPLING": ("REF NODE, ELSET", "nodes, weight"),
    "RIGID BODY": ("REF NODE, ROT NODE, NSET, TIE NSET, PIN NSET, POSITION=INPUT, (ISOTHERMAL)", ""),
    "CLOAD": ("OP=MOD|NEW, (AMPLITUDE)", "nodes, axis, force"),
    "BOUNDARY": ("OP=MOD|NEW, TYPE=DISPLACEMENT, (AMPLITUDE), (FIXED)", "nodes, first axis or name, last axis, value"),
    "DSLOAD": ("OP=MOD|NEW, (AMPLITUDE), (FOLLOWER)", "surface, kind, pressure, (x), (y), (z)"),
    "DLOAD": (
        "OP=MOD|NEW, (AMPLITUDE), (FOLLOWER)",
        "elements, kind, pressure, (x), (y), (z), (x of axis), (y of axis), (z of axis)",
    ),
    "INITIAL CONDITIONS": ("TYPE=TEMPERATURE, INPUT", ANY),
    "STEP": (ANY, ANY),
    "CONTACT PAIR": (ANY, "slave, master"),
    "SURFACE INTERACTION": (ANY, ANY),
    "CHANGE FRICTION": (ANY, ANY),
    "FRICTION": (ANY, ANY),
}
PLACED = ("TIE", "EQUATION", "COUPLING", "KINEMATIC", "DISTRIBUTING", "KINEMATIC COUPLING", "DISTRIBUTING COUPLING",
          "RIGID BODY", "CLOAD", "BOUNDARY", "DSLOAD", "DLOAD", "INITIAL CONDITIONS", "CONTACT PAIR")  # fmt: skip
# named supports -> axes that they hold
NAMED_SUPPORTS = {
    "ENCASTRE": (0, 1, 2, 3, 4, 5),
    "PINNED": (0, 1, 2),
    "XSYMM": (0, 4, 5),
    "YSYMM": (1, 3, 5),
    "ZSYMM": (2, 3, 4),
    "XASYMM": (1, 2, 3),
    "YASYMM": (0, 2, 4),
    "ZASYMM": (0, 1, 5),
}
# read first, as the points that they name are known by these names then, and tables of materials need temperatures
FIRST = {"COUPLING", "KINEMATIC", "DISTRIBUTING", "KINEMATIC COUPLING", "DISTRIBUTING COUPLING", "RIGID BODY",
         "INITIAL CONDITIONS", "SURFACE INTERACTION", "CHANGE FRICTION", "FRICTION"}  # fmt: skip
DIRECTED = ("CLOAD", "EQUATION", "KINEMATIC", "KINEMATIC COUPLING", "DISTRIBUTING")
TABLE = CardTable(
    read=", ".join(GRAMMAR),
    parameters={card: parameters for card, (parameters, _) in GRAMMAR.items()},
    fields={card: names for card, (_, names) in GRAMMAR.items()},
    silent="""HEADING, PREPRINT, RESTART, OUTPUT, NODE OUTPUT, ELEMENT OUTPUT, CONTACT OUTPUT, ENERGY OUTPUT,
        NODE PRINT, NODE FILE, EL PRINT, EL FILE, CONTACT PRINT, CONTACT FILE, END STEP, MONITOR, PRINT, ENERGY PRINT,
        SECTION PRINT, FILE FORMAT""",
    harmless={
        "the step is the scene's": """STATIC, FREQUENCY, DYNAMIC, BUCKLE, VISCO, STEADY STATE DYNAMICS, MODAL DYNAMIC,
            RANDOM RESPONSE, RESPONSE SPECTRUM, COMPLEX FREQUENCY, HEAT TRANSFER, SUBSTRUCTURE GENERATE,
            SUBSTRUCTURE MATRIX OUTPUT, SUBSTRUCTURE LOAD CASE, RETAINED NODAL DOFS, SELECT EIGENMODES, AMPLITUDE,
            MATRIX GENERATE, MATRIX OUTPUT, CONTROLS, SOLUTION TECHNIQUE, TIME POINTS, SECTION CONTROLS,
            HOURGLASS STIFFNESS, DISTRIBUTION TABLE, PHYSICAL CONSTANTS, USER OUTPUT, FILTER, NORMAL""",
        "damping is the scene's": "DAMPING, MODAL DAMPING, GLOBAL DAMPING, DAMPING CONTROLS",
        "bodies are elastic": "PLASTIC, CREEP, CYCLIC HARDENING, RATE DEPENDENT, CONDUCTIVITY, SPECIFIC HEAT",
        "contact is the scene's": """SURFACE BEHAVIOR, CONTACT, CONTACT INCLUSIONS,
            CONTACT EXCLUSIONS, CONTACT PROPERTY ASSIGNMENT, CONTACT CONTROLS, CONTACT CONTROLS ASSIGNMENT,
            CONTACT FORMULATION, CONTACT INITIALIZATION ASSIGNMENT, CONTACT INITIALIZATION DATA, CONTACT DAMPING,
            CLEARANCE, GAP CONDUCTANCE, SURFACE PROPERTY ASSIGNMENT""",
    },
)
