"""Reduced model -> response: harmonic balance with friction contact, continuation, wear.

harmonics, excitation                 basis and loads
balance, newton, krylov               the balance and how it is solved
rest                                  the preloaded state that friction begins from
mistuning                             wheels whose blades differ
outcome                               how a solve or a run ended
gradient, derivatives                 what a solution, a peak, a fold or a mode changes by with every number of it
threads                               how many threads may work
contact/                              joints and their laws
linear/                               compliance of the structure where it touches
continuation/                         response curves, folds, peaks, nonlinear modes
stability/                            which motions persist
wear/                                 laws of removal and the steps through cycles
time/                                 integration of the same model, to compare with
"""
