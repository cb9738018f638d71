"""The configurations of the leaf seal's study: what the thesis varies, one thing at a time (sections 6.3, 6.6).

Published are normalised values; their units are ours and stand here and in the scene: one unit of force is 1 kPa of
pressure, one of static liner displacement 0.5 mm (it tilts the leaf by a quarter of a degree), one of harmonic liner
displacement 20 um; K_n = 25 and K_spring = 1 are the stiffnesses that the fit found."""

from dataclasses import dataclass

from tribodyn.workflows.scene.schema import MeshScene

STATIC_UNIT, HARMONIC_UNIT = 0.5e-3, 20e-6  # [m] of one published unit of liner displacement (ours)
FORCE_UNIT = 1e3  # [Pa] of one published unit of force (ours)
CONTACT_UNITS, SPRING_UNITS = 25.0, 1.0  # published normalised stiffnesses of the scene
LINER: dict[int, tuple[float, complex]] = {  # table 6.1: number -> static and harmonic displacement, in units
    1: (0, 0), 2: (1, 0), 3: (-1, 0), 4: (0, 1), 5: (0, 1j), 6: (1, 1), 7: (-1, 1),
}  # fmt: skip
FORCES = (0.1, 0.2, 0.5, 1.0)
CONTACTS = (5.0, 12.5, 50.0, 100.0)
SPRINGS = (0.1, 0.5, 2.0, 10.0)
INCLINATIONS = (-4.0, -1.0, 1.0, 4.0)  # [degree], ours
BOWS = (-1.0, -0.3, 0.3, 1.0)  # [mm], ours


@dataclass(frozen=True)
class Case:
    """One configuration. group : the parameter that varies; label : its value; overrides : keys of the scene."""

    group: str
    label: str
    overrides: tuple[str, ...] = ()


def cases(scene: MeshScene) -> list[Case]:
    """All configurations; the scene itself is the flat, vertical leaf with the liner at rest."""
    contact = scene.contact.normal_stiffness or 0.0
    spring = scene.springs["left_pin"].stiffness

    def springs(units: float) -> tuple[str, ...]:
        value = spring * units / SPRING_UNITS
        return tuple(f"springs.{side}_pin.stiffness={value!r}" for side in ("left", "right"))

    return [
        *(Case("liner", f"({_number(s)}, {_number(h)})", liner(s, h)) for s, h in LINER.values()),
        *(Case("excitation", f"{f:g}", (force(f),)) for f in FORCES),
        *(
            Case("liner without force", f"({_number(s)}, {_number(h)})", (*liner(s, h), force(0.0)))
            for s, h in LINER.values()
            if h
        ),
        *(Case("K_n", f"{k:g}", (f"contact.normal_stiffness={contact * k / CONTACT_UNITS!r}",)) for k in CONTACTS),
        *(Case("K_spring", f"{k:g}", springs(k)) for k in SPRINGS),
        *(Case("inclination", f"{a:+g}°", (f"contact.inclination={a} deg",)) for a in INCLINATIONS),
        *(Case("bow", f"{b:+g} mm", (f"geometry.bow={b} mm",)) for b in BOWS),
    ]  # fmt: skip


def liner(static: float, harmonic: complex) -> tuple[str, ...]:
    """Overrides that move the liner, in published units; positive is towards the leaf."""
    if not static and not harmonic:
        return ()
    table = "motion.lower_contact"
    phase = 0.0 if complex(harmonic).imag == 0 else 90.0
    return (
        f'{table}.direction="z"',
        f"{table}.static={STATIC_UNIT * static!r}",
        f"{table}.harmonic={HARMONIC_UNIT * abs(harmonic)!r}",
        f"{table}.phase={phase} deg",
    )


def force(units: float) -> str:
    """Override of the harmonic pressure, in published units."""
    return f"loads.harmonic.pulsation.pressure={FORCE_UNIT * units!r}"


def _number(value: complex) -> str:
    return "i" if value == 1j else f"{complex(value).real:g}"
