"""How many small changes of the code its tests notice: `make mutants`.

`changes` makes them, `coverage_map` finds the tests that run a line, `run` tries each
change with these tests, `__main__` counts and writes the page.
"""
