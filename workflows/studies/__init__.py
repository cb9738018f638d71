"""Work on one scene beyond a run: backbones, identification."""
