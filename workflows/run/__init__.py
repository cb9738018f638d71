"""From a scene to a result: mesh, part, reduced model, balance, response, wear."""
