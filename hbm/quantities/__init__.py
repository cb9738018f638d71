"""The numbers that a run can state, one file each; the file's name is the number's name everywhere.

To add one: write `<name>.py` that ends with `QUANTITY = ...` of a class of `tribodyn.hbm.quantity`, which also has the
types that a value is computed from (`SolvedCycle`, `WornContact`, `SolvedCurve`).
Nothing else names it.

To use them, loop:

- `quantity.quantities_of(CycleQuantity)`, of WearQuantity, ...: declarations with name, label, title, unit, by_joint,
  relative, error; `quantity.with_error(CycleQuantity)`: those whose errors are stated; `quantity.load(name)`: one
- derivatives: `q.slopes(cycle)` of a CycleQuantity (adjoint); None where it has none
- of a result: `tribodyn.workflows.result.answers.answers_of(result)`, a tuple of `Answer(quantity, joint, moment,
  value, error, reason)`; `answer.column` is its name in tables of studies, such as "life",
  "peak_frequency_first" or "depth of shroud". `moment` is "first" or "last" (a cycle before wear, or at the peak of a
  response that does not wear, and at the end of wear), "peak" (of the response, where wear is at another frequency),
  "stable" (the highest stable point of the response) or "" (the whole run)
- errors: `result.verdict.statements[q.name]`"""
