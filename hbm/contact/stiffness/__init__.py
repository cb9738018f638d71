"""Contact stiffness of elastic bodies (Tamatam 2021, 2.4.1): a rectangular punch on a half-space in three dimensions.

It is the compliance of half-spaces. A finite element model that resolves the bodies under the patch already
holds most of that compliance: a contact stiffness from here then counts it twice, as the thesis does; a scene that
wants contact without it sets k_n and k_t by itself.
"""

from tribodyn.hbm.contact.stiffness.elastic import ElasticPair
from tribodyn.hbm.contact.stiffness.rectangle import rectangular_punch

__all__ = ["ElasticPair", "rectangular_punch"]
