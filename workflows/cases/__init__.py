"""Published cases: scene, study, trade, published numbers, figures and commands of each."""
