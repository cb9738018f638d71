"""Work on one scene beyond a run: tracking, backbones, identification."""
