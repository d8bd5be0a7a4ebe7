"""How many small changes of the code its tests notice: `make mutants`.

`groups` says of which modules, `operators` what is changed, `changes` makes modules of
it, `coverage_map` finds the tests that run a line, `trial` tries each change with these
tests, `__main__` counts and writes the page.
"""
