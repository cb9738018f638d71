"""Reduced model -> response: harmonic balance with friction contact, continuation, wear.

Basis and loads       harmonics, excitation, harmonic_choice
Contact               joint; law and the laws in contact/, aft, located, sampling, contact_stiffness/
Linear side           compliance, expansion, all_harmonics; travelling_wave, recovery
Balance               balance, newton, krylov, anderson; reference, the dense algorithm
Curves                continuation/, parameter, branch, outcome, bordered, folds, operating_point, residual_shear
Stability             stability, floquet, chatter; nonlinear_modes, free_vibration
Wear                  evolution, thesis_rule, error_controlled_rule, wearing, step_error, wear_history, wear_events,
                      wear_law and the laws in wear/, preload_at_rest
Beside it             time_integration, time_step, folds_in_time, verify, threads
"""
