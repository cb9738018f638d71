"""Speed against the dense algorithm, growth of cost, numerical extremes."""
