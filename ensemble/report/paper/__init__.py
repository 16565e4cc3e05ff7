"""The paper's figures and tables, computed again and set beside the published values.

How a section is written
------------------------
A section is one module here that ends with ``SECTION = Section(name, title, course)``, and is listed in
`ensemble.report.paper.sections`.  Its course is a generator: it yields what it needs, gets what has been
run, may ask for more as often as it likes, and returns its chapter::

    def _course(quick: bool) -> Course:
        cases = {rate: Case.of("doublet-shear", {"flow.rate": rate}) for rate in RATES[:: 3 if quick else 1]}
        boundary = StudyCase.of("critical-hamaker", {"sweep.values": [0.5, 1.0]})
        results = yield Plan(list(cases.values()), [boundary])
        rows = [
            number(f"period, γ̇ = {rate}", PUBLISHED[rate], results.summary(case).period, [case], allowed=1)
            for rate, case in cases.items()
        ]
        return Chapter(["What one sees (Markdown).", rows, Drawing("period", "Caption.", _figure(rows))])

- `Case` and `StudyCase` are a preset with changes, exactly as ``--set`` takes them: the commands in the
  report are theirs, and reproduce the very same runs.  An item of the paper that has no preset gets one.
- The plans of all sections are carried out together, on all ranks; what the store has is not run again.  A
  run that fails numerically is a result too (`Results.failed`), so a chapter must bear it.
- `number`, `bracket` and `words` compare; give `allowed` where a deviation is promised, None for a published
  value where the report goes past the paper.
- Published values are in ``published.toml``, with their source.
- ``quick`` thins what is run to about half a minute a section, on two ranks.
- Figures are made under `ensemble.figures.style.STYLE`, in the symbols of `ensemble.figures.symbols`.
"""
