"""A card that would change the structure and is not carried over is refused by its name; what is ignored is said."""

from pathlib import Path

import pytest

from tests.helpers.small_decks import ENDING, bricks, frequencies, straight
from tribodyn.geometry.sources import foreign_file
from tribodyn.workflows.run import decks
from tribodyn.workflows.scene.structure_tables import DeckTable

BAR = bricks((2, 1, 1), straight) + ENDING.replace(", ORIENTATION=OWN", "")
CARDS = {
    "*MPC": "*MPC\nBEAM, 1, 2\n",
    "*TRANSFORM": "*TRANSFORM, NSET=FOOT, TYPE=R\n1., 1., 0., -1., 1., 0.\n",
    "S4": "*ELEMENT, TYPE=S4, ELSET=SHELL\n9100, 1, 2, 3, 4\n",
    "*DLOAD, GRAV": "*DLOAD\nALL, GRAV, 9810., 0., 0., -1.\n",
    "*OF ANOTHER AGE": "*OF ANOTHER AGE\n1\n",
}


@pytest.mark.parametrize("name", CARDS)
def test_a_card_that_changes_the_structure_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not carried over") as raised:
        frequencies(BAR + CARDS[name], 2, tmp_path)
    assert f'"{name}"' in str(raised.value)
    assert list(foreign_file.read(tmp_path / "own.inp", "mm").refused) == [name]
    deck_text = decks.structure("d", DeckTable(file="own.inp", unit=1e-3, ignore=(name,)), {}, tmp_path)
    assert any("by ignore" in note for note in deck_text.notes)
    with pytest.raises(ValueError, match="ignore"):
        decks.structure("d", DeckTable(file="own.inp", unit=1e-3, ignore=(name, "*NOWHERE")), {}, tmp_path)
