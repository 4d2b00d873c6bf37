"""What the suite costs, measured beside what it cannot do without: relays that compute nothing, a copy of memory.

Absolute numbers belong to a machine and an hour; goals are ratios within one run wherever that is possible.
"""
