"""Response curves: continuation methods, folds, resonance peaks, nonlinear modes; the choice of harmonics.

A method is a module of `methods`, or a file of one's own, with `class Options` (its numbers) and
`follow(balance, start, stop, options, on_point=None) -> Branch`."""

from tribodyn.plugins import PluginKind

KIND = PluginKind("continuation", "tribodyn.hbm.continuation.methods", ("follow", "Options"), class_name="Options")
names, file_of, load, declared = KIND.names, KIND.file_of, KIND.load, KIND.declared
