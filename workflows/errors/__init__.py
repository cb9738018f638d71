"""One error system: what refinements of a scene change, and the total error of every number that follows."""
