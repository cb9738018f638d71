"""Curves of a scene beside its response: backbones, free decays, folds, and what follows a peak or a fold."""
