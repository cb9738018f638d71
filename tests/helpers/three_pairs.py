"""Three pairs of a random stiff structure, whose periodic motion doubles its period where they lift."""

from tests.helpers.verification_models import random_structure
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis

FLIPS_AT = 305.3  # 3 % below the first mode without contact


def three_pairs(friction: float, static: float, shaker: float, top: int, law: str = "jenkins") -> HarmonicBalance:
    model = random_structure(3)
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(3e6, 5e6), friction=friction)
    excitation = Excitation.of({"static": static}, {1: {"shaker": shaker}})
    basis = HarmonicBasis(tuple(range(top + 1)), 512)
    return HarmonicBalance.of(model, Joint("contact", law, parameters), basis, excitation, 1.2 * FLIPS_AT)
