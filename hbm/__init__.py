"""Reduced model -> response: harmonic balance with friction contact, continuation, wear.

harmonics, excitation                 basis and loads
balance, linearisation                the balance of a cycle and its derivatives
newton, criterion, krylov             how it is solved
rest, reference_springs               the preloaded state and the stuck springs that friction begins from
mistuned_wheel                        wheels whose blades differ
outcome                               how a solve or a run ended
quantity, quantity_sources            the numbers that a run states, and the types that they are computed from
fatigue, stress_numbers               stress over a cycle, its margin to fatigue, its largest at the places of a part
threads                               how many threads may work
contact/                              joints and their laws
linear/                               compliance of the structure at the contact
continuation/                         response curves, folds, peaks, nonlinear modes
derivatives/                          derivatives of a solution, a peak, a fold or a mode by every number of a scene
quantities/                           one file for each number that a run states
stability/                            which periodic solutions are stable
wear/                                 laws and rules of wear, and the steps through the cycles
time/                                 time integration of the same model"""
