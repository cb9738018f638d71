"""A run: settings and model of a scene, then response, wear and what else it asks for.

settings      what a scene asks of the solver        modelling    mesh, part, reduced model, harmonic balance
pipeline      a whole run, as prose                  wear_run     its wear, kept step by step"""
