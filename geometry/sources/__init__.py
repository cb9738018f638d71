"""Meshes, decks and CAD files of other programs -> bodies of second-order elements with their groups."""
