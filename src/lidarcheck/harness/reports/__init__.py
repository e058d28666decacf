"""What a run of the gate says to machines: results, JUnit, annotations.

`results` is the report itself, which the others are made from.
"""
