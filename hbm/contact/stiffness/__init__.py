"""Contact stiffness of elastic bodies in closed form or next to it (Tamatam 2021, 2.4.1).

hertz       sphere on plane, with Mindlin's tangential stiffness and partial slip
rounded     flat punch with rounded edges in plane strain, and the cylinder as its limit
rectangle   rectangular punch on a half-space in three dimensions: what a scene asks for

All of it is the compliance of half-spaces. A finite element model that resolves the bodies under the patch already
holds most of that compliance: a contact stiffness from here then counts it twice, as the thesis does; a scene that
wants contact without it sets k_n and k_t by itself.
"""

from tribodyn.hbm.contact.stiffness.elastic import ElasticPair
from tribodyn.hbm.contact.stiffness.hertz import SphereContact
from tribodyn.hbm.contact.stiffness.rectangle import rectangular_punch
from tribodyn.hbm.contact.stiffness.rounded import RoundedPunch

__all__ = ["ElasticPair", "RoundedPunch", "SphereContact", "rectangular_punch"]
