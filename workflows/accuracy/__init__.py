"""What a result is worth: budget, trade, promises, convergence, time integration beside it."""
