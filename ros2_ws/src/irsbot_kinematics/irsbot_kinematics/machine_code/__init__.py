"""The equations of a mechanism as machine code, for `evaluate_many`.

`symbols` records the operations of the equations, `source` writes them as C, `library` has them compiled and calls
them. Nothing is derived a second time: the equations of a mechanism do not branch on values, so one run on symbols
meets all of them.
"""
